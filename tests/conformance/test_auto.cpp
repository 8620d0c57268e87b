// The method auto: what it chooses, that it stops early, and that an island is solved alike whatever stands beside it.
#include <cairn/cairn.h>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

namespace {

template <class T> cairn_view view(std::vector<T>& values, std::size_t components, std::uint32_t type) {
    return {values.empty() ? nullptr : values.data(), static_cast<std::int64_t>(components * sizeof(T)), type, CAIRN_HOST};
}

// Boxes of 1 m in columns on a plane at y = 0, side by side, and chains that hang from the world.
struct World {
    std::vector<double> position, orientation, linear, angular, inverse_mass, inertia;
    std::vector<double> normal, arm_a, arm_b, separation, friction, contact_impulse;
    std::vector<std::int32_t> contact_a, contact_b, joint_a, joint_b;
    std::vector<std::uint64_t> contact_key, joint_key;
    std::vector<double> anchor_a, anchor_b;
    std::vector<std::uint32_t> axes;

    std::int32_t body(double x, double y, double mass) {
        position.insert(position.end(), {x, y, 0});
        orientation.insert(orientation.end(), {0, 0, 0, 1});
        linear.insert(linear.end(), {0, 0, 0});
        angular.insert(angular.end(), {0, 0, 0});
        inverse_mass.push_back(1 / mass);
        inertia.insert(inertia.end(), 3, 6 / mass);
        return static_cast<std::int32_t>(inverse_mass.size()) - 1;
    }
    void stand(std::int32_t a, std::int32_t b) { // a manifold of four
        for (const double x : {-0.5, 0.5})
            for (const double z : {-0.5, 0.5}) {
                contact_a.push_back(a);
                contact_b.push_back(b);
                normal.insert(normal.end(), {0, 1, 0});
                const auto at = static_cast<std::size_t>(b);
                if (a < 0)
                    arm_a.insert(arm_a.end(), {position[3 * at] + x, 0, z});
                else
                    arm_a.insert(arm_a.end(), {x, 0.5, z});
                arm_b.insert(arm_b.end(), {x, -0.5, z});
                separation.push_back(0);
                friction.push_back(0.5);
                contact_key.push_back(contact_key.size() + 1);
            }
    }
    void tie(std::int32_t a, std::int32_t b, double anchor) {
        joint_a.push_back(a);
        joint_b.push_back(b);
        if (a < 0)
            anchor_a.insert(anchor_a.end(), {position[3 * static_cast<std::size_t>(b)], anchor, 0});
        else
            anchor_a.insert(anchor_a.end(), {0, -0.5, 0});
        anchor_b.insert(anchor_b.end(), {0, 0.5, 0});
        joint_key.push_back(joint_key.size() + 1);
        std::uint32_t ball[6];
        ASSERT_EQ(cairn_joint_axes(CAIRN_JOINT_BALL, ball), CAIRN_OK);
        axes.insert(axes.end(), ball, ball + 6);
    }
    void column(double x, int boxes, double top) {
        std::int32_t below = CAIRN_WORLD;
        for (int i = 0; i < boxes; ++i) {
            const std::int32_t box = body(x, i + 0.5, i + 1 == boxes ? top : 1);
            stand(below, box);
            below = box;
        }
    }
    void chain(double x, int links, double last) {
        std::int32_t above = CAIRN_WORLD;
        for (int i = 0; i < links; ++i) {
            const std::int32_t link = body(x, 99.5 - i, i + 1 == links ? last : 1);
            tie(above, link, 100);
            above = link;
        }
    }
    cairn_status step(cairn_solver* solver) {
        cairn_bodies bodies = {};
        bodies.struct_size = sizeof bodies;
        bodies.count = static_cast<std::uint32_t>(inverse_mass.size());
        bodies.position = view(position, 3, CAIRN_F64);
        bodies.orientation = view(orientation, 4, CAIRN_F64);
        bodies.linear_velocity = view(linear, 3, CAIRN_F64);
        bodies.angular_velocity = view(angular, 3, CAIRN_F64);
        bodies.inverse_mass = view(inverse_mass, 1, CAIRN_F64);
        bodies.inverse_inertia = view(inertia, 3, CAIRN_F64);
        cairn_contacts contacts = {};
        contacts.struct_size = sizeof contacts;
        contacts.count = static_cast<std::uint32_t>(separation.size());
        contacts.body_a = view(contact_a, 1, CAIRN_I32);
        contacts.body_b = view(contact_b, 1, CAIRN_I32);
        contacts.normal = view(normal, 3, CAIRN_F64);
        contacts.arm_a = view(arm_a, 3, CAIRN_F64);
        contacts.arm_b = view(arm_b, 3, CAIRN_F64);
        contacts.separation = view(separation, 1, CAIRN_F64);
        contacts.friction = view(friction, 1, CAIRN_F64);
        contacts.key = view(contact_key, 1, CAIRN_U64);
        cairn_joints joints = {};
        joints.struct_size = sizeof joints;
        joints.count = static_cast<std::uint32_t>(joint_a.size());
        joints.body_a = view(joint_a, 1, CAIRN_I32);
        joints.body_b = view(joint_b, 1, CAIRN_I32);
        joints.anchor_a = view(anchor_a, 3, CAIRN_F64);
        joints.anchor_b = view(anchor_b, 3, CAIRN_F64);
        joints.axes = view(axes, 6, CAIRN_U32);
        joints.key = view(joint_key, 1, CAIRN_U64);
        cairn_step step = {};
        step.struct_size = sizeof step;
        step.dt = 1.0 / 60;
        step.gravity[1] = -9.81;
        step.bodies = &bodies;
        step.contacts = contacts.count > 0 ? &contacts : nullptr;
        step.joints = joints.count > 0 ? &joints : nullptr;
        contact_impulse.assign(separation.size(), -1);
        cairn_results results = {};
        results.struct_size = sizeof results;
        results.position = bodies.position;
        results.orientation = bodies.orientation;
        results.linear_velocity = bodies.linear_velocity;
        results.angular_velocity = bodies.angular_velocity;
        results.contact_impulse = view(contact_impulse, 1, CAIRN_F64);
        return cairn_solver_step(solver, &step, &results);
    }
};

struct Auto : testing::Test {
    ~Auto() override {
        for (cairn_solver* solver : solvers)
            cairn_solver_destroy(solver);
    }
    cairn_solver* make(double tolerance = 1e-3, std::uint32_t threads = 1, std::uint32_t instructions = CAIRN_ISA_AUTO) {
        cairn_config config = {};
        config.struct_size = sizeof config;
        config.backend = CAIRN_BACKEND_CPU;
        config.threads = threads;
        config.instructions = instructions;
        cairn_solver* solver = nullptr;
        EXPECT_EQ(cairn_solver_create(&config, &solver), CAIRN_OK) << cairn_last_error();
        solvers.push_back(solver);
        cairn_params params = {};
        params.struct_size = sizeof params;
        EXPECT_EQ(cairn_params_preset(CAIRN_METHOD_AUTO, CAIRN_PRESET_DEFAULT, &params), CAIRN_OK);
        params.tolerance = tolerance;
        EXPECT_EQ(cairn_solver_set_params(solver, &params), CAIRN_OK) << cairn_last_error();
        return solver;
    }
    static std::vector<cairn_choice> choices(cairn_solver* solver) {
        std::size_t count = 0;
        EXPECT_EQ(cairn_solver_choices(solver, nullptr, 0, &count), CAIRN_OK);
        std::vector<cairn_choice> found(count);
        EXPECT_EQ(cairn_solver_choices(solver, found.data(), count, &count), CAIRN_OK);
        return found;
    }
    static cairn_statistics statistics(cairn_solver* solver) {
        cairn_statistics found = {};
        found.struct_size = sizeof found;
        EXPECT_EQ(cairn_solver_get_statistics(solver, &found), CAIRN_OK);
        return found;
    }
    std::vector<cairn_solver*> solvers;
};

// One island of every kind.
void every_kind(World& w) {
    w.body(-5, 50, 1);
    w.column(0, 3, 1);
    w.column(3, 3, 100);
    w.chain(6, 2, 1);
    w.chain(9, 2, 100);
    w.chain(12, 8, 1);
}

TEST_F(Auto, ChoosesByWhatAnIslandIsMadeOf) {
    World w;
    every_kind(w);
    const std::int32_t a = w.body(20, 99.5, 1), b = w.body(20, 98.5, 1); // a ring, over the world
    w.tie(CAIRN_WORLD, a, 100);
    w.tie(a, b, 0);
    w.tie(CAIRN_WORLD, b, 99);
    cairn_solver* solver = make();
    ASSERT_EQ(w.step(solver), CAIRN_OK) << cairn_last_error();
    const std::vector<cairn_choice> found = choices(solver);
    const std::uint32_t reasons[] = {CAIRN_REASON_ALONE, CAIRN_REASON_CONTACTS, CAIRN_REASON_UNEVEN, CAIRN_REASON_JOINTS,
                                     CAIRN_REASON_STIFF, CAIRN_REASON_STIFF,    CAIRN_REASON_STIFF};
    const std::uint32_t bodies[] = {1, 3, 3, 2, 2, 8, 2};
    ASSERT_EQ(found.size(), std::size(reasons));
    std::uint32_t first = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].reason, reasons[i]) << i;
        EXPECT_EQ(found[i].bodies, bodies[i]) << i;
        EXPECT_EQ(found[i].first_body, first) << i;
        EXPECT_LT(found[i].method, CAIRN_METHOD_AUTO) << i;
        EXPECT_LE(found[i].swept, found[i].iterations) << i;
        EXPECT_NE(cairn_reason_text(found[i].reason), nullptr);
        first += bodies[i];
    }
    const cairn_statistics sum = statistics(solver);
    EXPECT_EQ(sum.islands, found.size());
    EXPECT_EQ(sum.bodies, w.inverse_mass.size());
    EXPECT_EQ(sum.contacts, w.separation.size());
    EXPECT_EQ(sum.joints, w.joint_a.size());
    EXPECT_EQ(sum.substeps, 10u);
}

TEST_F(Auto, StopsWhereTheToleranceIsMetAndSaysSo) {
    World loose_world, tight_world, whole_world;
    std::uint32_t swept[3] = {};
    World* worlds[] = {&loose_world, &tight_world, &whole_world};
    const double tolerances[] = {1e-2, 1e-4, 0};
    for (int k = 0; k < 3; ++k) {
        worlds[k]->chain(0, 2, 1);
        cairn_solver* solver = make(tolerances[k]);
        ASSERT_EQ(worlds[k]->step(solver), CAIRN_OK) << cairn_last_error();
        const std::vector<cairn_choice> found = choices(solver);
        ASSERT_EQ(found.size(), 1u);
        swept[k] = found[0].swept;
        EXPECT_EQ(found[0].met, tolerances[k] > 0 ? 1u : 0u);
        EXPECT_EQ(found[0].met != 0, found[0].residual < tolerances[k]);
        EXPECT_EQ(statistics(solver).iterations, swept[k]);
    }
    EXPECT_LT(swept[0], swept[1]);
    EXPECT_LT(swept[1], swept[2]);
    EXPECT_EQ(swept[2], 300u);

    World w; // and that it could not be met
    w.column(0, 10, 1);
    cairn_solver* solver = make(1e-6);
    cairn_params params = {};
    params.struct_size = sizeof params;
    ASSERT_EQ(cairn_solver_get_params(solver, &params), CAIRN_OK);
    params.iterations = params.substeps = 3;
    ASSERT_EQ(cairn_solver_set_params(solver, &params), CAIRN_OK) << cairn_last_error();
    ASSERT_EQ(w.step(solver), CAIRN_OK);
    ASSERT_EQ(choices(solver).size(), 1u);
    EXPECT_EQ(choices(solver)[0].met, 0u);
    EXPECT_EQ(choices(solver)[0].swept, 3u);
    EXPECT_GE(choices(solver)[0].residual, 1e-6);
}

// What more sweeps would not mend is left to the next substep, unless the island is still violent, or the tolerance is 0.
TEST_F(Auto, EndsASubstepAfterEnoughSweeps) {
    const auto swept = [this](double tolerance, double stretch) {
        World w;
        w.chain(0, 8, 1);
        for (std::size_t i = 0; i < w.position.size(); i += 3)
            w.position[i + 1] *= stretch;
        cairn_solver* solver = make(tolerance);
        EXPECT_EQ(w.step(solver), CAIRN_OK) << cairn_last_error();
        EXPECT_EQ(choices(solver).at(0).met, 0u);
        EXPECT_EQ(choices(solver).at(0).substeps, 10u);
        return choices(solver).at(0).swept;
    };
    EXPECT_EQ(swept(1e-9, 1), 10u * (12 + 6)); // with bias and without
    EXPECT_EQ(swept(0, 1), 300u);
    EXPECT_GT(swept(1e-9, 2), 10u * (12 + 6));
}

// A column of nine is slender, one of eight is not, nor is a wall as high as it is wide.
TEST_F(Auto, TellsAColumnFromAWall) {
    World w;
    w.column(0, 9, 1);
    w.column(3, 8, 1);
    std::vector<std::int32_t> below(12, CAIRN_WORLD);
    for (int row = 0; row < 12; ++row) {
        std::vector<std::int32_t> laid;
        for (std::size_t i = 0; i < below.size(); ++i) { // in bond
            laid.push_back(w.body(6 + static_cast<double>(i) + 0.5 * row, row + 0.5, 1));
            w.stand(below[i], laid.back());
            if (row > 0 && i + 1 < below.size())
                w.stand(below[i + 1], laid.back());
        }
        below = laid;
    }
    cairn_solver* solver = make();
    ASSERT_EQ(w.step(solver), CAIRN_OK) << cairn_last_error();
    const std::vector<cairn_choice> found = choices(solver);
    ASSERT_EQ(found.size(), 3u);
    EXPECT_EQ(found[0].reason, CAIRN_REASON_SLENDER);
    EXPECT_EQ(found[0].substeps, 10u);
    EXPECT_EQ(found[1].reason, CAIRN_REASON_CONTACTS);
    EXPECT_EQ(found[1].substeps, 4u);
    EXPECT_EQ(found[2].reason, CAIRN_REASON_CONTACTS);
    EXPECT_EQ(found[2].bodies, 144u);
}

TEST_F(Auto, ThreadsAndInstructionsChangeNoBit) {
    World reference;
    every_kind(reference);
    cairn_solver* scalar = make(1e-3, 1, CAIRN_ISA_SCALAR);
    World wide;
    every_kind(wide);
    cairn_solver* widest = make(1e-3, 3, CAIRN_ISA_AUTO);
    for (int i = 0; i < 10; ++i) {
        ASSERT_EQ(reference.step(scalar), CAIRN_OK) << cairn_last_error();
        ASSERT_EQ(wide.step(widest), CAIRN_OK) << cairn_last_error();
    }
    EXPECT_EQ(reference.position, wide.position);
    EXPECT_EQ(reference.linear, wide.linear);
    EXPECT_EQ(reference.contact_impulse, wide.contact_impulse);
    const std::vector<cairn_choice> a = choices(scalar), b = choices(widest);
    ASSERT_EQ(a.size(), b.size());
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]), 0);
}

TEST_F(Auto, AnIslandIsSolvedAlikeWhateverStandsBesideIt) {
    World alone, among;
    alone.column(0, 5, 1);
    among.column(0, 5, 1);
    const std::size_t numbers = alone.position.size();
    among.column(3, 3, 100);
    among.chain(6, 8, 1);
    among.column(9, 4, 1);
    cairn_solver *one = make(), *other = make();
    for (int i = 0; i < 10; ++i) {
        ASSERT_EQ(alone.step(one), CAIRN_OK) << cairn_last_error();
        ASSERT_EQ(among.step(other), CAIRN_OK) << cairn_last_error();
        EXPECT_EQ(std::memcmp(alone.position.data(), among.position.data(), numbers * sizeof(double)), 0) << i;
        EXPECT_EQ(std::memcmp(alone.linear.data(), among.linear.data(), numbers * sizeof(double)), 0) << i;
        EXPECT_EQ(std::memcmp(alone.contact_impulse.data(), among.contact_impulse.data(), alone.contact_impulse.size() * sizeof(double)),
                  0);
        EXPECT_EQ(std::memcmp(&choices(one)[0], &choices(other)[0], sizeof(cairn_choice)), 0) << i;
    }
}

// A column whose top grows heavy goes another way, and still starts from what it knew; so does one that is restored from a blob.
TEST_F(Auto, WarmStartsSurviveAChangeOfKind) {
    World w;
    w.column(0, 4, 1);
    cairn_solver* solver = make();
    for (int i = 0; i < 5; ++i)
        ASSERT_EQ(w.step(solver), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(choices(solver)[0].reason, CAIRN_REASON_CONTACTS);
    w.inverse_mass.back() = 1e-2;
    std::size_t size = 0;
    ASSERT_EQ(cairn_solver_save_cache(solver, nullptr, 0, &size), CAIRN_OK);
    std::vector<unsigned char> blob(size);
    ASSERT_EQ(cairn_solver_save_cache(solver, blob.data(), size, &size), CAIRN_OK);
    ASSERT_EQ(w.step(solver), CAIRN_OK);
    EXPECT_EQ(choices(solver)[0].reason, CAIRN_REASON_UNEVEN);
    EXPECT_EQ(statistics(solver).warm_started, 16u);
    World v;
    v.column(0, 4, 100);
    cairn_solver* restored = make();
    ASSERT_EQ(cairn_solver_load_cache(restored, blob.data(), size), CAIRN_OK) << cairn_last_error();
    ASSERT_EQ(v.step(restored), CAIRN_OK);
    EXPECT_EQ(statistics(restored).warm_started, 16u);
}

TEST_F(Auto, OtherMethodsMakeNoChoices) {
    World w;
    w.column(0, 2, 1);
    cairn_solver* solver = nullptr;
    ASSERT_EQ(cairn_solver_create(nullptr, &solver), CAIRN_OK);
    solvers.push_back(solver);
    ASSERT_EQ(w.step(solver), CAIRN_OK);
    EXPECT_TRUE(choices(solver).empty());
    std::size_t count = 0;
    EXPECT_EQ(cairn_solver_choices(solver, nullptr, 0, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
    cairn_solver* chooser = make();
    ASSERT_EQ(w.step(chooser), CAIRN_OK);
    cairn_choice one = {};
    EXPECT_EQ(cairn_solver_choices(chooser, &one, 0, &count), CAIRN_ERROR_BUFFER_TOO_SMALL);
    EXPECT_EQ(count, 1u);
}

} // namespace
