// The counted bytes are what a sweep touches: found by changing one number after the other and looking whether the sweep notices.
#include "traffic.h"
#include "world.h"

#include "cpu/kernels.h"
#include "scene/scene.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <set>

namespace cairn_bench {
namespace {

using cairn::Column;
using Numbers = std::vector<float>;

template <class T> Column columnOf(const std::vector<T>& values, std::size_t components, cairn::Type type) {
    Column column;
    if (values.empty())
        return column;
    column.data = reinterpret_cast<const std::byte*>(values.data());
    column.stride = static_cast<std::ptrdiff_t>(components * sizeof(T));
    column.type = type;
    return column;
}
cairn::Input inputOf(const World& world) {
    const auto floats = [](const Numbers& values, std::size_t components) { return columnOf(values, components, cairn::Type::f32); };
    const auto integers = [](const std::vector<std::int32_t>& values) { return columnOf(values, 1, cairn::Type::i32); };
    cairn::Input input;
    input.dt = world.dt;
    input.bodies.count = world.bodies();
    input.bodies.position = floats(world.position, 3);
    input.bodies.orientation = floats(world.orientation, 4);
    input.bodies.linear_velocity = floats(world.linearVelocity, 3);
    input.bodies.angular_velocity = floats(world.angularVelocity, 3);
    input.bodies.inverse_mass = floats(world.inverseMass, 1);
    input.bodies.inverse_inertia = floats(world.inverseInertia, 3);
    input.contacts.count = world.points();
    input.contacts.body_a = integers(world.bodyA);
    input.contacts.body_b = integers(world.bodyB);
    input.contacts.normal = floats(world.normal, 3);
    input.contacts.arm_a = floats(world.armA, 3);
    input.contacts.arm_b = floats(world.armB, 3);
    input.contacts.separation = floats(world.separation, 1);
    input.contacts.friction = floats(world.friction, 1);
    input.joints.count = world.joints();
    input.joints.body_a = integers(world.jointA);
    input.joints.body_b = integers(world.jointB);
    input.joints.anchor_a = floats(world.anchorA, 3);
    input.joints.anchor_b = floats(world.anchorB, 3);
    input.joints.axes = columnOf(world.axes, 6, cairn::Type::u32);
    return input;
}

struct Variant {
    const char* name;
    std::uint32_t splitting, friction, acceleration;
};
void PrintTo(const Variant& variant, std::ostream* to) { *to << variant.name; }
class Traffic : public testing::TestWithParam<Variant> {};
INSTANTIATE_TEST_SUITE_P(Sweeps, Traffic,
                         testing::Values(Variant{"paper", CAIRN_SPLIT_POINT, CAIRN_FRICTION_CONE, CAIRN_ACCELERATION_NONE},
                                         Variant{"pyramid", CAIRN_SPLIT_POINT, CAIRN_FRICTION_PYRAMID, CAIRN_ACCELERATION_NONE},
                                         Variant{"smooth", CAIRN_SPLIT_POINT, CAIRN_FRICTION_NONE, CAIRN_ACCELERATION_NONE},
                                         Variant{"smooth_nesterov", CAIRN_SPLIT_POINT, CAIRN_FRICTION_NONE, CAIRN_ACCELERATION_NESTEROV},
                                         Variant{"nesterov", CAIRN_SPLIT_POINT, CAIRN_FRICTION_CONE, CAIRN_ACCELERATION_NESTEROV},
                                         Variant{"manifold", CAIRN_SPLIT_MANIFOLD, CAIRN_FRICTION_CONE, CAIRN_ACCELERATION_NESTEROV}),
                         [](const auto& of) { return std::string(of.param.name); });

cairn_params paramsOf(const Variant& variant) {
    cairn_params params{};
    params.struct_size = sizeof params;
    EXPECT_EQ(cairn_params_preset(CAIRN_METHOD_PJ, CAIRN_PRESET_PAPER, &params), CAIRN_OK);
    params.splitting = variant.splitting;
    params.friction_model = variant.friction;
    params.acceleration = variant.acceleration;
    return params;
}

// One constraint, its hot fields filled with arbitrary numbers; sweeps it and tells which fields mattered and which were written.
class Probe {
  public:
    Probe(const World& world, const Variant& variant) : m_scene(cairn::Hooks{}), m_joint(world.joints() > 0) {
        cairn::Params params = cairn::preset(cairn::Method::pj, cairn::Preset::paper);
        params.splitting = static_cast<cairn::Splitting>(variant.splitting);
        params.friction_model = static_cast<cairn::Friction>(variant.friction);
        params.acceleration = static_cast<cairn::Acceleration>(variant.acceleration);
        m_scene.pack(inputOf(world), params, cairn::WarmStartCache{});
        stage(cairn::Stage::inertia);
        stage(cairn::Stage::begin);
        for (const cairn::Stage each : {cairn::Stage::build, cairn::Stage::apply_start})
            stage(each);
    }
    // Fields read or written by a sweep, each as often as it moves: a field that is both counts twice.
    unsigned moved() {
        std::set<std::size_t> read, written;
        for (unsigned seed = 1; seed <= 40; ++seed) { // clamps hide some fields in some states
            fill(seed);
            const Numbers before = all(), clean = swept();
            for (std::size_t field = 0; field < fields(); ++field)
                if (different(clean[field * cairn::kGroup], before[field * cairn::kGroup]))
                    written.insert(field);
            for (std::size_t field = 0; field < fields(); ++field) {
                restore(before);
                at(field) += 0.37F;
                Numbers after = swept();
                after[field * cairn::kGroup] = clean[field * cairn::kGroup]; // itself does not tell
                if (std::memcmp(after.data(), clean.data(), clean.size() * sizeof(float)) != 0)
                    read.insert(field);
            }
        }
        return static_cast<unsigned>(read.size() + written.size());
    }

  private:
    std::size_t fields() const {
        if (m_joint)
            return cairn::kJointFields;
        return cairn::kContactFields;
    }
    float* hot() { return m_joint ? m_scene.frame.joint : m_scene.frame.contact; }
    float& at(std::size_t field) { return hot()[field * cairn::kGroup]; }
    static bool different(float a, float b) { return std::memcmp(&a, &b, sizeof a) != 0; }
    void stage(cairn::Stage which) {
        const cairn::Frame<float>& f = m_scene.frame;
        const cairn::Domain domain = cairn::domain_of(which);
        const std::uint32_t count = domain == cairn::Domain::islands   ? f.island_count
                                    : domain == cairn::Domain::movable ? f.movable_count
                                                                       : f.contact_groups + f.joint_groups;
        cairn::kernels_scalar::run_stage(which, f, 0, count);
    }
    void fill(unsigned seed) {
        std::mt19937 random(seed);
        const auto next = [&] { return 0.5F + 0.125F * static_cast<float>(random() % 9); };
        for (std::size_t field = 0; field < fields(); ++field)
            at(field) = next();
        if (!m_joint)
            at(cairn::kBias) = -9 * next(); // pushes, so that there is friction
        for (std::size_t row = 0; row < 8 * (std::size_t{m_scene.frame.body_count} + 1); ++row) {
            const bool control = row % 4 == 3; // momentum, active
            m_scene.frame.velocity[row] = control ? 1 : 0.1F * next();
        }
    }
    // The constraint's fields, its slots, its share of the island's sums.
    Numbers all() {
        const cairn::Frame<float>& f = m_scene.frame;
        Numbers values(hot(), hot() + fields() * cairn::kGroup);
        for (const std::int32_t slot : {f.slot_a[0], f.slot_b[0]})
            values.insert(values.end(), f.slots + 8 * slot, f.slots + 8 * slot + 8);
        values.push_back(f.partial_restart[f.lane_partial[0]]);
        values.push_back(f.partial_residual[f.lane_partial[0]]);
        return values;
    }
    void restore(const Numbers& values) { std::copy_n(values.begin(), fields() * cairn::kGroup, hot()); }
    Numbers swept() {
        stage(cairn::Stage::sweep);
        return all();
    }

    cairn::Scene<float> m_scene;
    bool m_joint;
};

// A sphere on another.
World onePoint() {
    World world = pile(64);
    const auto keep = [&](std::size_t i) {
        World one;
        for (const std::int32_t body : {world.bodyA[i], world.bodyB[i]})
            for (std::size_t c = 0, b = static_cast<std::size_t>(body); c < 3; ++c) {
                one.position.push_back(world.position[3 * b + c]);
                one.inverseInertia.push_back(world.inverseInertia[3 * b + c]);
            }
        one.orientation = {0, 0, 0, 1, 0, 0, 0, 1};
        one.linearVelocity = one.angularVelocity = Numbers(6, 0.0F);
        one.inverseMass = Numbers(2, 1.0F);
        one.bodyA = {0};
        one.bodyB = {1};
        const auto three = [i](const Numbers& from) {
            return Numbers(from.begin() + std::ptrdiff_t(3 * i), from.begin() + std::ptrdiff_t(3 * i + 3));
        };
        one.normal = three(world.normal);
        one.armA = three(world.armA);
        one.armB = three(world.armB);
        one.separation = {world.separation[i]};
        one.friction = {world.friction[i]};
        return one;
    };
    for (std::size_t i = 0; i < world.points(); ++i)
        if (world.bodyA[i] >= 0 &&
            (world.round[static_cast<std::size_t>(world.bodyA[i])] || world.round[static_cast<std::size_t>(world.bodyB[i])]))
            return keep(i);
    return world;
}
World oneJoint() {
    World world = chain();
    world.jointA = {0};
    world.jointB = {1};
    for (Numbers* values : {&world.anchorA, &world.anchorB})
        values->resize(3);
    world.axes.resize(6);
    return world;
}

TEST_P(Traffic, OfAPoint) {
    ASSERT_EQ(onePoint().points(), 1u);
    EXPECT_EQ(pointBytes(paramsOf(GetParam())), sizeof(float) * Probe(onePoint(), GetParam()).moved());
}
TEST_P(Traffic, OfAJoint) { EXPECT_EQ(jointBytes(paramsOf(GetParam())), sizeof(float) * Probe(oneJoint(), GetParam()).moved()); }

// By hand, for the paper's preset: 116 bytes of a point; four indices, two slots written; a velocity read and a slot read again for each
// side that can move; a body's velocity read and written and its mass in two rows, and where its slots begin.
TEST(TrafficOfASweep, AddsUp) {
    cairn_params params = paramsOf({"", CAIRN_SPLIT_POINT, CAIRN_FRICTION_CONE, CAIRN_ACCELERATION_NONE});
    Load load;
    load.points = 4;
    load.manifolds = 1;
    load.bodies = 1;
    load.movableSides = 1; // the other is the world
    EXPECT_EQ(sweepBytes(load, params, false), 4 * 116 + 16 + 64 + 64 + 132);
    EXPECT_EQ(sweepBytes(load, params, true), 4 * 116 + 28 + 64 + 64 + 132);
    load.movableSides = 2;
    EXPECT_EQ(sweepBytes(load, params, true), 4 * 116 + 28 + 64 + 128 + 132);
}

} // namespace
} // namespace cairn_bench
