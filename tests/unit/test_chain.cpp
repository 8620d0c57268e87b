// The hardest of the paper's scenes: a ball 300 times as heavy as each of 50 links, swinging on their hinges.
#include "methods.h"

namespace cairn_test {
namespace {

// scenes.md's chain-1m, hanging out horizontally, y up: links of 1 kg at x = 0.5 ... 49.5, the ball at 52.
Scene chain() {
    Scene scene;
    scene.gravity = Vec3(0, -9.81, 0);
    const Axes hinge = axes_of(CAIRN_JOINT_HINGE);
    for (int i = 0; i < 50; ++i) {
        scene.add(Body::box(1, {0.4, 0.2, 0.2}, {i + 0.5, 0, 0}));
        scene.join(i == 0 ? CAIRN_WORLD : i - 1, i, {static_cast<double>(i), 0, 0}, hinge);
    }
    const int ball = scene.add(Body::sphere(300, 2, {52, 0, 0}));
    scene.join(49, ball, {50, 0, 0}, hinge);
    for (std::size_t i = 0; i < scene.joints.size(); ++i)
        scene.joints[i].key = i + 1;
    return scene;
}

struct Outcome {
    double gap = 0, energy_gain = 0; // m, worst; J, worst rise of the total energy over the start's
    bool finite = true;
};
Outcome swing(const cairn_params& params, int frames) {
    Scene scene = chain();
    const Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    const double start = scene.kinetic_energy() + scene.potential_energy();
    Outcome outcome;
    for (int frame = 0; frame < frames; ++frame) {
        scene.step(solver);
        double gap = 0;
        for (const Joint& joint : scene.joints)
            gap = std::max(gap, joint_gap(scene, joint).norm());
        const double energy = scene.kinetic_energy() + scene.potential_energy();
        outcome.finite = outcome.finite && std::isfinite(gap) && std::isfinite(energy);
        outcome.gap = std::max(outcome.gap, gap);
        outcome.energy_gain = std::max(outcome.energy_gain, energy - start);
    }
    return outcome;
}

struct Run {
    std::uint32_t method, preset;
};
class Chain : public testing::TestWithParam<Run> {};
INSTANTIATE_TEST_SUITE_P(EveryPreset, Chain, testing::ValuesIn([] {
                             std::vector<Run> runs;
                             for (std::uint32_t m = 0; m < CAIRN_METHOD_AUTO; ++m) {
                                 runs.push_back({m, CAIRN_PRESET_DEFAULT});
                                 runs.push_back({m, CAIRN_PRESET_PAPER});
                             }
                             return runs;
                         }()),
                         [](const testing::TestParamInfo<Run>& run) {
                             return std::string(cairn_method_name(run.param.method)) +
                                    (run.param.preset == CAIRN_PRESET_PAPER ? "_paper" : "_default");
                         });

// Bounded: 3000 frames without leaving the numbers or losing the ball. The methods with substeps also keep the chain together and
// never hold more energy than the fall could give; so do those without, save with the paper's own parameters, where links spin.
TEST_P(Chain, StaysBoundedFor3000Frames) {
    const auto [method, which] = GetParam();
    cairn_params params = preset(method, which);
    params.iterations = 300;
    const bool substeps = method == CAIRN_METHOD_TJ || method == CAIRN_METHOD_TJSOFT;
    if (substeps)
        params.substeps = 10;
    double fall = 0; // J, if every body fell as far below the pin as it now is beside it
    for (const Body& body : chain().bodies)
        fall += 9.81 * body.position.x() / body.inverse_mass;
    const Outcome outcome = swing(params, 3000);
    RecordProperty("worst_gap_m", std::to_string(outcome.gap));
    RecordProperty("energy_gain_J", std::to_string(outcome.energy_gain));
    std::printf("worst gap %.4f m, energy gained %.1f J of %.0f\n", outcome.gap, outcome.energy_gain, fall);
    EXPECT_TRUE(outcome.finite);
    EXPECT_LT(outcome.gap, 52) << "the ball is lost";
    if (substeps || which == CAIRN_PRESET_DEFAULT) {
        EXPECT_LT(outcome.energy_gain, fall);
    }
    if (!substeps)
        return;
    const double limit = which == CAIRN_PRESET_DEFAULT ? 0.03 : method == CAIRN_METHOD_TJ ? 0.05 : 0.1;
    EXPECT_LE(outcome.gap, limit);
}

} // namespace
} // namespace cairn_test
