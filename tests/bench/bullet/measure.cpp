#include "measure.h"

#include "../program.h"

#include <algorithm>
#include <cmath>

namespace cairn_bench::bullet {
namespace {

constexpr int kStockIterations = 10; // Bullet's default
constexpr int kWarmUps = 5;

double least(const std::vector<double>& values) { return *std::min_element(values.begin(), values.end()); }

// Each part by itself.
StepTimes partwise(const std::vector<StepTimes>& all, double (*of)(const std::vector<double>&)) {
    StepTimes result;
    for (double StepTimes::*part : {&StepTimes::step, &StepTimes::solver, &StepTimes::gather, &StepTimes::scatter, &StepTimes::sweeps}) {
        std::vector<double> values;
        for (const StepTimes& times : all)
            values.push_back(times.*part);
        result.*part = of(values);
    }
    return result;
}

int settlingSteps(const std::string& scene, const Options& options) {
    if (options.settle >= 0)
        return options.settle;
    if (scene == "wall")
        return options.quick ? 10 : 20;
    return options.quick ? 60 : 250;
}

std::string named(const std::string& scene, std::size_t bodies) { return scene + " of " + std::to_string(bodies); }

void settle(Subject& subject, const std::string& scene, std::size_t bodies, const Options& options, const Told& told) {
    for (int i = 0; i < settlingSteps(scene, options); ++i) {
        told(named(scene, bodies) + ": settling");
        subject.step();
    }
}

// Cairn's iterations for which its median solver time is stock's, both in turn from the state that they are in. The time is taken to be
// linear in the iterations, from two measured points on.
class Match {
  public:
    struct Found {
        std::uint32_t iterations;
        double stock, cairn; // s
    };
    Match(Subject& stock, CairnSubject& cairn, const Told& told, std::string what)
        : m_stock(stock), m_cairn(cairn), m_told(told), m_what(std::move(what)) {}

    Found found() {
        const auto off = [](const Found& at) { return at.cairn / at.stock - 1; };
        const double slope = (off(timed(60)) - off(timed(10))) / 50;
        double guess = 10;
        Found best = timed(10);
        for (int round = 0; round < 8 && std::abs(off(best)) >= 0.02; ++round) {
            guess = std::max(1.0, guess - off(timed(guess)) / std::max(slope, 1e-6));
            const Found next = timed(guess);
            if (std::abs(off(next)) < std::abs(off(best)))
                best = next;
        }
        return best;
    }

  private:
    Found timed(double iterations) {
        constexpr int kSteps = 7;
        const std::uint32_t wanted = static_cast<std::uint32_t>(std::lround(iterations));
        m_cairn.setIterations(wanted);
        m_cairn.step(); // at its new number of sweeps
        std::vector<double> stock, cairn;
        for (int i = 0; i < kSteps; ++i) {
            m_told(m_what);
            stock.push_back(m_stock.step().solver);
            cairn.push_back(m_cairn.step().solver);
        }
        return {wanted, median(stock), median(cairn)};
    }
    Subject& m_stock;
    CairnSubject& m_cairn;
    const Told& m_told;
    std::string m_what;
};

// A run of --quality.
class Run {
  public:
    Run(Subject& subject, bool fromStart, int steps) : m_subject(subject), m_steps(steps) {
        if (fromStart)
            m_places = subject.scene().state();
        m_fromStart = fromStart;
    }
    void step(int i) {
        if (i == m_steps / 2 && !m_fromStart)
            m_places = m_subject.scene().state();
        m_subject.step();
        if (i < m_steps / 2)
            return;
        const Scene::Depth depth = m_subject.scene().depth();
        m_worst = std::max(m_worst, depth.worst);
        m_sum += depth.sum;
        m_points += depth.points;
        const double speed = m_subject.scene().rmsSpeed();
        m_square += speed * speed / (m_steps - m_steps / 2);
    }
    void finish(Quality& to) const {
        to.worstDepth = m_worst;
        to.meanDepth = m_points > 0 ? m_sum / static_cast<double>(m_points) : 0;
        to.drift = m_subject.scene().farthestFrom(m_places);
        to.speed = std::sqrt(m_square);
    }

  private:
    Subject& m_subject;
    int m_steps;
    bool m_fromStart = false;
    std::vector<State> m_places;
    double m_worst = 0, m_sum = 0, m_square = 0;
    std::size_t m_points = 0;
};

} // namespace

std::vector<Speed> measureSpeed(const std::string& scene, std::size_t bodies, const Options& options, const Told& told) {
    StockSubject stock(scene, bodies, kStockIterations);
    settle(stock, scene, bodies, options, told);
    CairnSubject one(scene, bodies, 1), many(scene, bodies, options.threads);
    one.scene().set(stock.scene().state());
    many.scene().set(stock.scene().state());
    Subject* const subjects[] = {&stock, &one, &many};
    std::vector<StepTimes> times[3];
    const int steps = options.steps > 0 ? options.steps : (options.quick ? 7 : 20);
    for (int i = -kWarmUps; i < steps; ++i)
        for (int s = 0; s < 3; ++s) {
            told(named(scene, bodies) + ": step " + std::to_string(std::max(i, 0)) + " of " + std::to_string(steps));
            const StepTimes spent = subjects[s]->step();
            if (i >= 0)
                times[s].push_back(spent);
        }
    if (one.scene().hash() != many.scene().hash())
        throw std::runtime_error(named(scene, bodies) + ": on " + std::to_string(many.threads()) +
                                 " threads Cairn gave other bits than on one");
    std::vector<Speed> found;
    for (int s = 0; s < 3; ++s)
        found.push_back({scene, bodies, s == 0 ? "stock" : "cairn", s == 2 ? many.threads() : 1, subjects[s]->points(),
                         partwise(times[s], median), partwise(times[s], least), subjects[s]->scene().hash()});
    return found;
}

Pair matchTimes(const std::string& scene, std::size_t bodies, std::uint32_t iterations, const Options& options, const Told& told) {
    StockSubject stock(scene, bodies, kStockIterations);
    settle(stock, scene, bodies, options, told);
    stock.scene().info().m_numIterations = static_cast<int>(iterations);
    CairnSubject cairn(scene, bodies, options.threads);
    cairn.scene().set(stock.scene().state());
    const std::string what = named(scene, bodies) + ", stock " + std::to_string(iterations) + ": matching times";
    const Match::Found found = Match(stock, cairn, told, what).found();
    cairn.setIterations(found.iterations);
    return {Quality{scene, bodies, "stock", iterations, 1, 1e3 * found.stock},
            Quality{scene, bodies, "cairn", found.iterations, cairn.params().substeps, 1e3 * found.cairn}};
}

void measureQuality(Pair& pair, const Options& options, const Told& told) {
    auto& [stock, cairn] = pair;
    StockSubject stockSubject(stock.scene, stock.bodies, static_cast<int>(stock.iterations));
    CairnSubject cairnSubject(cairn.scene, cairn.bodies, options.threads);
    cairnSubject.setIterations(cairn.iterations);
    const int steps = options.steps > 0 ? options.steps : (options.quick ? 120 : 600);
    const bool fromStart = stock.scene == "wall";
    Run stockRun(stockSubject, fromStart, steps), cairnRun(cairnSubject, fromStart, steps);
    for (int i = 0; i < steps; ++i) {
        told(named(stock.scene, stock.bodies) + ", stock " + std::to_string(stock.iterations) + ": step " + std::to_string(i) + " of " +
             std::to_string(steps));
        stockRun.step(i);
        cairnRun.step(i);
    }
    stockRun.finish(stock);
    cairnRun.finish(cairn);
}

} // namespace cairn_bench::bullet
