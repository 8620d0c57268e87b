// The threads that may run the sweeps, btContactSolverInfo, and the world that never calls a plain solver; matrix/worlds.cpp has the
// others.
#include "world.h"

#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <LinearMath/btThreads.h>

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <thread>

namespace {

cairn_config oneThread() {
    cairn_config config = {};
    config.struct_size = sizeof config;
    config.threads = 1;
    return config;
}

TEST(Worlds, AMultiBodyWorldIsToldApart) {
    TestWorld parts;
    parts.cairn->setErrorCallback([](void*, cairn_status, const char*) {}, nullptr);
    btMultiBodyConstraintSolver own;
    btMultiBodyDynamicsWorld world(&parts.dispatcher, &parts.broadphase, &own, &parts.configuration);
    world.setConstraintSolver(parts.cairn);
    btSphereShape shape(1);
    btRigidBody ball(btRigidBody::btRigidBodyConstructionInfo(1, nullptr, &shape, btVector3(1, 1, 1)));
    world.addRigidBody(&ball);
    world.stepSimulation(kDt, 0);
    world.removeRigidBody(&ball);
    EXPECT_EQ(parts.cairn->lastStatus(), CAIRN_ERROR_UNSUPPORTED);
    EXPECT_NE(std::string(parts.cairn->lastError()).find("btMultiBodyDynamicsWorld"), std::string::npos) << parts.cairn->lastError();
}

// ---- Threads ---------------------------------------------------------------------------------------------------------

// Debian's Bullet has no threads of its own, but an application may bring some.
class Threads : public btITaskScheduler {
  public:
    explicit Threads(int count) : btITaskScheduler("threads"), m_count(count) {}
    int getMaxNumThreads() const override { return m_count; }
    int getNumThreads() const override { return m_count; }
    void setNumThreads(int count) override { m_count = count; }
    void parallelFor(int begin, int end, int, const btIParallelForBody& body) override {
        ++calls;
        std::vector<std::thread> threads;
        for (int i = begin; i < end; ++i)
            threads.emplace_back([&body, i] { body.forLoop(i, i + 1); });
        for (std::thread& thread : threads)
            thread.join();
    }
    btScalar parallelSum(int begin, int end, int, const btIParallelSumBody& body) override { return body.sumLoop(begin, end); }
    int calls = 0;

  private:
    int m_count;
};

std::vector<btVector3> wall(const cairn_config& config) {
    TestWorld w;
    cairn::bullet::ConstraintSolver solver(CAIRN_METHOD_TJSOFT, CAIRN_PRESET_DEFAULT, &config);
    w.world->setConstraintSolver(&solver);
    w.world->getSolverInfo().m_numIterations = 1; // few sweeps: it is bits that count here
    w.floor();
    for (int i = 0; i < 300; ++i)
        w.box(1, btVector3(btScalar(i % 30), btScalar(0.5) + btScalar(i / 30), 0));
    w.step(3);
    EXPECT_EQ(solver.lastStatus(), CAIRN_OK) << solver.lastError();
    EXPECT_EQ(solver.statistics().threads, config.threads);
    std::vector<btVector3> state;
    for (const std::unique_ptr<btRigidBody>& body : w.bodies) {
        state.push_back(body->getWorldTransform().getOrigin());
        state.push_back(body->getAngularVelocity());
    }
    return state;
}

TEST(Worlds, SweepsRunOnBulletsTaskScheduler) {
    Threads three(3);
    const std::vector<btVector3> expected = wall(oneThread());
    EXPECT_EQ(wall(cairn::bullet::onTaskScheduler(&three)), expected);
    EXPECT_GT(three.calls, 0);
    EXPECT_EQ(wall(cairn::bullet::onTaskScheduler(btGetSequentialTaskScheduler())), expected);
    EXPECT_EQ(cairn::bullet::onTaskScheduler(nullptr).parallel_for, nullptr);
}

// ---- btContactSolverInfo ---------------------------------------------------------------------------------------------

cairn_params preset(uint32_t method) {
    cairn_params params = {};
    params.struct_size = sizeof params;
    EXPECT_EQ(cairn_params_preset(method, CAIRN_PRESET_DEFAULT, &params), CAIRN_OK);
    return params;
}

TEST(Info, DefaultsLeaveThePresetAsItIs) {
    for (uint32_t method = 0; method < CAIRN_METHOD_COUNT; ++method) {
        const cairn_params before = preset(method), after = cairn::bullet::fromBullet(btContactSolverInfo(), before);
        EXPECT_EQ(std::memcmp(&before, &after, sizeof before), 0) << cairn_method_name(method);
    }
}

TEST(Info, EachFieldMovesWhatTheTableSays) {
    const cairn_params usual = preset(CAIRN_METHOD_TJSOFT);
    const auto moved = [&usual](const std::function<void(btContactSolverInfo&)>& change) {
        btContactSolverInfo info;
        change(info);
        return cairn::bullet::fromBullet(info, usual);
    };
    EXPECT_EQ(moved([](btContactSolverInfo& i) { i.m_numIterations = 5; }).iterations, usual.iterations / 2);
    EXPECT_EQ(moved([](btContactSolverInfo& i) { i.m_numIterations = 0; }).iterations, usual.substeps);
    EXPECT_EQ(moved([](btContactSolverInfo& i) { i.m_numIterations = 50; }).iterations, usual.iterations);
    EXPECT_EQ(moved([](btContactSolverInfo& i) { i.m_numIterations = 1000; }).iterations, 1000u);
    const cairn_params slow = moved([](btContactSolverInfo& i) { i.m_erp2 = btScalar(0.1); });
    EXPECT_NEAR(slow.contact_hertz, usual.contact_hertz / 2, 1e-5);
    EXPECT_NEAR(slow.contact_hertz_floor, usual.contact_hertz_floor / 2, 1e-8);
    EXPECT_EQ(slow.contact_damping_ratio, usual.contact_damping_ratio);
    EXPECT_EQ(moved([](btContactSolverInfo& i) { i.m_erp2 = btScalar(0.1); }).joint_hertz, usual.joint_hertz);
    EXPECT_NEAR(moved([](btContactSolverInfo& i) { i.m_erp = btScalar(0.1); }).joint_baumgarte, usual.joint_baumgarte / 2, 1e-6);
    EXPECT_EQ(moved([](btContactSolverInfo& i) { i.m_erp = 1; }).joint_baumgarte, 1) << "at most all of the error";
    EXPECT_EQ(moved([](btContactSolverInfo& i) { i.m_solverMode &= ~SOLVER_USE_WARMSTARTING; }).contact_warm_start, 0);
    EXPECT_NEAR(moved([](btContactSolverInfo& i) { i.m_warmstartingFactor /= 2; }).contact_warm_start, usual.contact_warm_start / 2, 1e-6);
}

TEST(Info, IsFollowedUntilParametersAreSet) {
    TestWorld w;
    w.box(1, btVector3(0, 0, 0));
    const auto iterations = [&w] {
        w.step();
        cairn_params params = {};
        params.struct_size = sizeof params;
        EXPECT_EQ(cairn_solver_get_params(w.cairn->handle(), &params), CAIRN_OK);
        return params.iterations;
    };
    w.world->getSolverInfo().m_numIterations = 700;
    EXPECT_EQ(iterations(), 700u);
    EXPECT_NE(w.cairn->params().iterations, 700u);
    cairn_params own = w.cairn->params();
    own.iterations = 40;
    ASSERT_EQ(w.cairn->setParams(own), CAIRN_OK);
    EXPECT_EQ(iterations(), 40u);
    w.cairn->followInfo(true);
    EXPECT_EQ(iterations(), 700u);
    ASSERT_EQ(w.cairn->setMethod(CAIRN_METHOD_TJ), CAIRN_OK);
    EXPECT_EQ(iterations(), 700u);
}

TEST(Info, WhatIsNoNumberIsRefused) {
    TestWorld w;
    w.cairn->setErrorCallback([](void*, cairn_status, const char*) {}, nullptr);
    w.box(1, btVector3(0, 0, 0));
    w.world->getSolverInfo().m_erp2 = std::numeric_limits<btScalar>::quiet_NaN();
    w.step();
    EXPECT_EQ(w.cairn->lastStatus(), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(std::string(w.cairn->lastError()).find("contact_"), std::string::npos) << w.cairn->lastError();
}

} // namespace
