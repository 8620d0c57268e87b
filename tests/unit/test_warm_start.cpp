// The warm-start cache: found by key, forgotten without one, saved and loaded so that a run goes on with the same bits.
#include "methods.h"
#include "shapes.h"

namespace cairn_test {
namespace {

class WarmStart : public EachMethod {};
CAIRN_EACH_METHOD(WarmStart);

const Vec3 kHalf(0.3, 0.3, 0.2);

// A box and a ball on a plane, the ball tethered to the box.
Scene resting() {
    Scene scene;
    scene.gravity = Vec3(0, 0, -9.81);
    scene.add(Body::box(2, kHalf, {0, 0, kHalf.z()}));
    scene.add(Body::sphere(1, 0.2, {0.6, 0, 0.2}));
    scene.join(0, 1, {0.45, 0, 0.2}, axes_of(CAIRN_JOINT_BALL));
    scene.joints[0].key = 77;
    return scene;
}
void touch(Scene& scene) {
    scene.contacts.clear();
    touch_box(scene, 0, kHalf, Plane{}, 0.5);
    touch_sphere(scene, 1, 0.2, Plane{}, 0.5);
}
cairn_params warm(std::uint32_t method) {
    cairn_params params = preset(method);
    params.contact_warm_start = 1;
    params.joint_warm_start = 0.5;
    return params;
}

TEST_P(WarmStart, FindsImpulsesByKey) {
    Scene scene = resting();
    const Solver solver;
    const cairn_params params = warm(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    const auto found = [&] {
        scene.step(solver);
        return solver.statistics().warm_started;
    };
    touch(scene);
    EXPECT_EQ(found(), 0u);
    touch(scene);
    EXPECT_EQ(found(), 6u);
    touch(scene);
    scene.contacts[2].key = 0; // never found again
    scene.joints[0].key = 78;  // another joint
    EXPECT_EQ(found(), 4u);
    touch(scene);
    scene.joints[0].key = 77; // forgotten meanwhile
    EXPECT_EQ(found(), 4u);
    touch(scene);
    std::reverse(scene.contacts.begin(), scene.contacts.begin() + 4); // the key counts, not the place
    EXPECT_EQ(found(), 6u);
    check(cairn_solver_reset(solver.get()));
    touch(scene);
    EXPECT_EQ(found(), 0u);
}

TEST_P(WarmStart, ColdPresetNeverLooks) {
    Scene scene = resting();
    const Solver solver;
    const cairn_params params = preset(GetParam(), CAIRN_PRESET_PAPER);
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 3; ++frame) {
        touch(scene);
        scene.step(solver);
        EXPECT_EQ(solver.statistics().warm_started, 0u);
    }
}

// What it is for: at rest a single sweep a substep suffices once the impulses are known.
TEST_P(WarmStart, OneSweepHoldsWhatIsAlreadySolved) {
    double sag[2];
    for (const double share : {0.0, 1.0}) {
        Scene scene;
        scene.gravity = Vec3(0, 0, -9.81);
        scene.add(Body::box(2, kHalf, {0, 0, kHalf.z()}));
        const Solver solver;
        cairn_params params = warm(GetParam());
        params.contact_warm_start = share;
        params.substeps = 1;
        params.acceleration = CAIRN_ACCELERATION_NONE;
        params.splitting = CAIRN_SPLIT_POINT;
        params.position_iterations = 0;
        params.relax_share = 0;
        double speed = 0;
        for (int frame = 0; frame < 30; ++frame) {
            params.iterations = frame < 20 ? 100 : 1;
            check(cairn_solver_set_params(solver.get(), &params));
            scene.contacts.clear();
            touch_box(scene, 0, kHalf, Plane{}, 0.5);
            scene.step(solver);
            if (frame >= 20)
                speed = std::max(speed, scene.bodies[0].linear.norm());
        }
        sag[share > 0] = speed;
    }
    EXPECT_LT(sag[true], 1e-3);
    EXPECT_GT(sag[false], 1e-2) << "warm start makes no difference here: this test checks nothing";
}

// A contact that loses its friction keeps no friction impulse from before: the box slides freely.
TEST_P(WarmStart, FrictionThatCeasesLeavesNothingBehind) {
    Scene scene;
    scene.gravity = Vec3(2, 0, -10);
    scene.add(Body::box(1, kHalf, {0, 0, kHalf.z()}));
    const Solver solver;
    const cairn_params params = warm(GetParam());
    check(cairn_solver_set_params(solver.get(), &params));
    Impulses out;
    for (int frame = 0; frame < 40; ++frame) {
        scene.contacts.clear();
        touch_box(scene, 0, kHalf, Plane{}, frame < 20 ? 0.5 : 0);
        out = scene.step(solver);
    }
    EXPECT_NEAR(scene.bodies[0].linear.x(), 20 * 2 * scene.dt, 0.02);
    for (std::size_t i = 0; i < scene.contacts.size(); ++i)
        EXPECT_EQ(out.friction_of(i).norm(), 0);
}

// Likewise a joint whose limit is taken away.
TEST_P(WarmStart, ALimitThatIsGoneLeavesNothingBehind) {
    Scene scene;
    scene.gravity = Vec3(10, 0, 0);
    scene.add(Body::box(1, kHalf, Vec3::Zero()));
    Joint joint;
    joint.b = 0;
    joint.key = 7;
    joint.axes = {CAIRN_AXIS_LIMITED, 1, 1, 1, 1, 1};
    joint.lower[0] = -1;
    scene.joints.push_back(joint);
    const Solver solver;
    cairn_params params = warm(GetParam());
    params.joint_warm_start = 0.5;
    check(cairn_solver_set_params(solver.get(), &params));
    for (int frame = 0; frame < 40; ++frame) {
        if (frame == 20) {
            EXPECT_NEAR(scene.bodies[0].linear.x(), 0, 0.02);
            scene.joints[0].axes[0] = CAIRN_AXIS_FREE;
        }
        scene.step(solver);
    }
    EXPECT_NEAR(scene.bodies[0].linear.x(), 20 * 10 * scene.dt, 0.05);
}

TEST_P(WarmStart, ASavedCacheContinuesWithTheSameBits) {
    Scene scene = resting();
    scene.bodies[0].linear = Vec3(0.5, 0.2, 0);
    const cairn_params params = warm(GetParam());
    const Solver first;
    check(cairn_solver_set_params(first.get(), &params));
    const auto run = [](Scene& s, const Solver& solver) {
        for (int frame = 0; frame < 15; ++frame) {
            touch(s);
            s.step(solver);
        }
        return s.hash();
    };
    run(scene, first);
    const std::vector<char> saved = first.save_cache();
    ASSERT_FALSE(saved.empty());
    Scene copy = scene, cold = scene;
    const std::uint64_t continued = run(scene, first);

    Solver second;
    check(cairn_solver_set_params(second.get(), &params));
    second.load_cache(saved);
    EXPECT_EQ(second.save_cache(), saved);
    EXPECT_EQ(run(copy, second), continued);
    const Solver third;
    check(cairn_solver_set_params(third.get(), &params));
    EXPECT_NE(run(cold, third), continued) << "the cache makes no difference here: this test checks nothing";
}

TEST_P(WarmStart, SavingSaysHowMuchIsNeededAndBadBlobsAreRefused) {
    Scene scene = resting();
    const cairn_params params = warm(GetParam());
    Solver solver;
    check(cairn_solver_set_params(solver.get(), &params));
    touch(scene);
    scene.step(solver);
    const std::vector<char> saved = solver.save_cache();
    std::vector<char> small(saved.size() - 1, 'x');
    std::size_t size = 0;
    EXPECT_EQ(cairn_solver_save_cache(solver.get(), small.data(), small.size(), &size), CAIRN_ERROR_BUFFER_TOO_SMALL);
    EXPECT_EQ(size, saved.size());
    EXPECT_EQ(small, std::vector<char>(saved.size() - 1, 'x'));
    for (std::size_t cut = 0; cut < saved.size(); cut += 7) {
        EXPECT_NE(cairn_solver_load_cache(solver.get(), saved.data(), cut), CAIRN_OK) << "of " << cut << " bytes";
    }
    std::vector<char> longer = saved, garbled = saved;
    longer.push_back(0);
    EXPECT_NE(cairn_solver_load_cache(solver.get(), longer.data(), longer.size()), CAIRN_OK);
    garbled[0] = static_cast<char>(garbled[0] ^ 0x55);
    EXPECT_NE(cairn_solver_load_cache(solver.get(), garbled.data(), garbled.size()), CAIRN_OK);
    EXPECT_EQ(solver.save_cache(), saved) << "a refused blob changed the cache";
}

} // namespace
} // namespace cairn_test
