#include "survey.h"

#include "islands.h"
#include "pack.h"

#include <algorithm>
#include <numeric>

namespace cairn {

// Breadth first over the contacts, from what cannot move.
void Survey::measure_heights(const Input& input) {
    const std::size_t bodies = body_island.size();
    const auto moves = [&](std::int64_t body) { return body >= 0 && body_island[static_cast<std::size_t>(body)] != kNone; };
    const ContactColumns& contacts = input.contacts;
    first_.assign(bodies + 1, 0); // neighbours of body i: neighbour_[first_[i]] to first_[i + 1]
    height_.assign(bodies, kNone);
    queue_.clear();
    for (std::size_t c = 0; c < contacts.count; ++c) {
        const std::int64_t a = contacts.body_a.integer(c), b = contacts.body_b.integer(c);
        if (moves(a) && moves(b)) {
            ++first_[static_cast<std::size_t>(a) + 1];
            ++first_[static_cast<std::size_t>(b) + 1];
        } else if (moves(a) || moves(b)) {
            const auto body = static_cast<std::uint32_t>(moves(a) ? a : b);
            if (height_[body] == kNone) {
                height_[body] = 1;
                queue_.push_back(body);
            }
        }
    }
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    neighbour_.resize(first_[bodies]);
    next_.assign(first_.begin(), first_.end() - 1);
    for (std::size_t c = 0; c < contacts.count; ++c) {
        const std::int64_t a = contacts.body_a.integer(c), b = contacts.body_b.integer(c);
        if (!moves(a) || !moves(b))
            continue;
        neighbour_[next_[static_cast<std::size_t>(a)]++] = static_cast<std::uint32_t>(b);
        neighbour_[next_[static_cast<std::size_t>(b)]++] = static_cast<std::uint32_t>(a);
    }
    for (std::size_t at = 0; at < queue_.size(); ++at) {
        const std::uint32_t body = queue_[at];
        std::uint32_t& most = islands[body_island[body]].features.height;
        most = std::max(most, height_[body]);
        for (std::uint32_t n = first_[body]; n < first_[body + 1]; ++n)
            if (height_[neighbour_[n]] == kNone) {
                height_[neighbour_[n]] = height_[body] + 1;
                queue_.push_back(neighbour_[n]);
            }
    }
}

void Survey::look(const Input& input) {
    const auto bodies = static_cast<std::uint32_t>(input.bodies.count);
    body_island.assign(bodies, 0);
    for (std::uint32_t i = 0; i < bodies; ++i)
        body_island[i] = is_movable(input.bodies, i) ? 0 : kNone;
    const auto moves = [&](std::int64_t body) { return body >= 0 && body_island[static_cast<std::size_t>(body)] != kNone; };
    const auto every_pair = [](const auto& table, const auto& visit) {
        for (std::size_t i = 0; i < table.count; ++i)
            visit(table.body_a.integer(i), table.body_b.integer(i));
    };

    parent_.resize(bodies);
    std::iota(parent_.begin(), parent_.end(), 0u);
    const auto tie = [&](std::int64_t a, std::int64_t b) {
        if (moves(a) && moves(b))
            unite(parent_, static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b));
    };
    every_pair(input.contacts, tie);
    every_pair(input.joints, tie);
    every_pair(input.rows, tie);

    islands.clear();
    for (std::uint32_t i = 0; i < bodies; ++i) {
        if (body_island[i] == kNone)
            continue;
        const std::uint32_t root = find_root(parent_, i);
        if (root == i) {
            body_island[i] = static_cast<std::uint32_t>(islands.size());
            islands.push_back({i, {}, Reason::alone});
        } else {
            body_island[i] = body_island[root];
        }
        Features& f = islands[body_island[i]].features;
        ++f.bodies;
        if (const double inverse = input.bodies.inverse_mass.real(i); inverse > 0) {
            const double mass = 1 / inverse;
            f.mass += mass;
            f.lightest = f.lightest > 0 ? std::min(f.lightest, mass) : mass;
            f.heaviest = std::max(f.heaviest, mass);
        }
    }
    const auto features_of = [&](std::int64_t a, std::int64_t b) -> Features* {
        const std::int64_t body = moves(a) ? a : b;
        return moves(body) ? &islands[body_island[static_cast<std::size_t>(body)]].features : nullptr;
    };
    every_pair(input.contacts, [&](std::int64_t a, std::int64_t b) {
        if (Features* f = features_of(a, b))
            ++f->contacts;
    });
    every_pair(input.rows, [&](std::int64_t a, std::int64_t b) {
        if (Features* f = features_of(a, b))
            ++f->rows;
    });
    // A ring closes where a joint ties two bodies that joints have tied already. Everything that cannot move is one more body; what
    // other islands tie to it ties no two bodies of this one.
    if (input.joints.count > 0) {
        joined_.resize(bodies + std::size_t{1});
        std::iota(joined_.begin(), joined_.end(), 0u);
    }
    every_pair(input.joints, [&](std::int64_t a, std::int64_t b) {
        Features* f = features_of(a, b);
        if (!f)
            return;
        ++f->joints;
        const std::uint32_t at_a = moves(a) ? static_cast<std::uint32_t>(a) : bodies,
                            at_b = moves(b) ? static_cast<std::uint32_t>(b) : bodies;
        if (find_root(joined_, at_a) == find_root(joined_, at_b))
            f->loop = true;
        else
            unite(joined_, at_a, at_b);
    });
    measure_heights(input);
    for (Island& island : islands)
        island.reason = reason_of(island.features);
}

} // namespace cairn
