// Parameters, configuration and the calls that copy something out.
#include <cairn/cairn.h>

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <vector>

namespace {

bool says(const char* text) { return std::string(cairn_last_error()).find(text) != std::string::npos; }

class RefusedSettings : public ::testing::Test {
  protected:
    void SetUp() override { ASSERT_EQ(cairn_solver_create(nullptr, &solver), CAIRN_OK) << cairn_last_error(); }
    void TearDown() override { cairn_solver_destroy(solver); }

    cairn_params preset(std::uint32_t method) {
        cairn_params params = {};
        params.struct_size = sizeof params;
        EXPECT_EQ(cairn_params_preset(method, CAIRN_PRESET_DEFAULT, &params), CAIRN_OK) << cairn_last_error();
        return params;
    }
    cairn_params current() {
        cairn_params params = {};
        params.struct_size = sizeof params;
        EXPECT_EQ(cairn_solver_get_params(solver, &params), CAIRN_OK);
        return params;
    }
    template <class Value> void refused(std::uint32_t method, Value cairn_params::*field, Value value, const char* text) {
        cairn_params params = preset(method);
        params.*field = value;
        const cairn_params before = current();
        EXPECT_EQ(cairn_solver_set_params(solver, &params), CAIRN_ERROR_INVALID_ARGUMENT) << text;
        EXPECT_TRUE(says(text)) << cairn_last_error();
        const cairn_params after = current();
        EXPECT_EQ(std::memcmp(&before, &after, sizeof before), 0) << text;
    }

    cairn_solver* solver = nullptr;
};

} // namespace

TEST_F(RefusedSettings, EveryPresetIsAccepted) {
    for (std::uint32_t method = 0; method < CAIRN_METHOD_COUNT; ++method)
        for (std::uint32_t which : {CAIRN_PRESET_DEFAULT, CAIRN_PRESET_PAPER}) {
            if (method == CAIRN_METHOD_AUTO && which == CAIRN_PRESET_PAPER)
                continue; // the paper does not have it
            cairn_params params = {};
            params.struct_size = sizeof params;
            ASSERT_EQ(cairn_params_preset(method, which, &params), CAIRN_OK);
            EXPECT_EQ(params.method, method);
            EXPECT_EQ(cairn_solver_set_params(solver, &params), CAIRN_OK) << cairn_method_name(method) << ": " << cairn_last_error();
            const cairn_params kept = current();
            EXPECT_EQ(std::memcmp(&kept, &params, sizeof params), 0);
        }
    cairn_params params = {};
    params.struct_size = sizeof params;
    EXPECT_EQ(cairn_params_preset(6, CAIRN_PRESET_DEFAULT, &params), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("method is 6")) << cairn_last_error();
    EXPECT_EQ(cairn_params_preset(0, 2, &params), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("preset is 2")) << cairn_last_error();
    EXPECT_EQ(cairn_params_preset(CAIRN_METHOD_AUTO, CAIRN_PRESET_PAPER, &params), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("preset is 1")) << cairn_last_error();
    EXPECT_EQ(cairn_params_preset(0, 0, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
}

TEST_F(RefusedSettings, ParametersOutOfRange) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
    using P = cairn_params;
    constexpr std::uint32_t tj = CAIRN_METHOD_TJ, soft = CAIRN_METHOD_TJSOFT;
    refused(tj, &P::iterations, 0u, "params.iterations is 0: must be 1 ... 1000000");
    refused(tj, &P::iterations, 1000001u, "params.iterations is 1000001");
    refused(tj, &P::substeps, 0u, "params.substeps is 0: must be 1 ... 1000");
    refused(tj, &P::substeps, 1001u, "params.substeps is 1001");
    for (std::uint32_t method : {CAIRN_METHOD_PJ, CAIRN_METHOD_PJNJ, CAIRN_METHOD_PJSOFT})
        refused(method, &P::substeps, 2u, "params.substeps is 2: must be 1 for the method pj");
    refused(tj, &P::substeps, 1000u, "params.substeps is 1000: must be at most params.iterations");
    refused(CAIRN_METHOD_PJNJ, &P::position_iterations, 1000001u, "params.position_iterations is 1000001");
    refused(tj, &P::relax_share, 1.0, "params.relax_share is 1: must be 0 ... below 1");
    refused(tj, &P::relax_share, -0.5, "params.relax_share is -0.5");
    refused(tj, &P::restitution_iterations, 1000001u, "params.restitution_iterations is 1000001");
    refused(tj, &P::splitting, 2u, "params.splitting is 2: must be 0 ... 1");
    refused(tj, &P::friction_model, 3u, "params.friction_model is 3");
    refused(tj, &P::acceleration, 2u, "params.acceleration is 2");
    refused(tj, &P::residual_trace, 2u, "params.residual_trace is 2");
    refused(tj, &P::contact_warm_start, 1.5, "params.contact_warm_start is 1.5: must be 0 ... 1");
    refused(tj, &P::joint_warm_start, -0.5, "params.joint_warm_start is -0.5");
    refused(tj, &P::contact_baumgarte, nan, "params.contact_baumgarte is nan");
    refused(tj, &P::joint_baumgarte, 2.0, "params.joint_baumgarte is 2");
    refused(soft, &P::contact_hertz, 0.0, "params.contact_hertz is 0: must be > 0");
    refused(soft, &P::contact_damping_ratio, -1.0, "params.contact_damping_ratio is -1");
    refused(soft, &P::joint_hertz, infinity, "params.joint_hertz is inf");
    refused(soft, &P::joint_damping_ratio, nan, "params.joint_damping_ratio is nan");
    refused(soft, &P::hertz_limit, 0.0, "params.hertz_limit is 0");
    refused(soft, &P::static_hertz_scale, 0.0, "params.static_hertz_scale is 0");
    refused(soft, &P::contact_hertz_floor, -0.1, "params.contact_hertz_floor is -0.1");
    refused(tj, &P::max_push_speed, 0.0, "params.max_push_speed is 0");
    refused(tj, &P::restitution_threshold, -1.0, "params.restitution_threshold is -1");
    refused(tj, &P::residual_tolerance, infinity, "params.residual_tolerance is inf");
    refused(tj, &P::tolerance, 1e-3, "params.tolerance is 0.001: must be 0 for the method tj");
    refused(CAIRN_METHOD_AUTO, &P::tolerance, -1.0, "params.tolerance is -1");
    refused(CAIRN_METHOD_AUTO, &P::tolerance, nan, "params.tolerance is nan");
    refused(CAIRN_METHOD_AUTO, &P::residual_tolerance, 1.0, "params.residual_tolerance is 1: must be 0 for the method auto");
    cairn_params params = preset(tj);
    params.method = 6;
    EXPECT_EQ(cairn_solver_set_params(solver, &params), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("method is 6")) << cairn_last_error();
}

TEST_F(RefusedSettings, ShorterParametersGetTheMethodsDefaults) {
    cairn_params params = preset(CAIRN_METHOD_PJ);
    params.struct_size = 3 * sizeof(std::uint32_t);
    params.iterations = 77;
    params.substeps = 99; // not read: beyond struct_size
    ASSERT_EQ(cairn_solver_set_params(solver, &params), CAIRN_OK) << cairn_last_error();
    cairn_params expected = preset(CAIRN_METHOD_PJ);
    expected.iterations = 77;
    const cairn_params kept = current();
    EXPECT_EQ(std::memcmp(&kept, &expected, sizeof kept), 0);

    cairn_params part = {};
    part.struct_size = offsetof(cairn_params, substeps);
    part.substeps = 123;
    ASSERT_EQ(cairn_solver_get_params(solver, &part), CAIRN_OK);
    EXPECT_EQ(part.iterations, 77u);
    EXPECT_EQ(part.substeps, 123u); // not written
    EXPECT_EQ(part.struct_size, offsetof(cairn_params, substeps));

    part.struct_size = offsetof(cairn_params, contact_warm_start) + 4; // half a number
    EXPECT_EQ(cairn_solver_get_params(solver, &part), CAIRN_ERROR_STRUCT_SIZE);
}

TEST_F(RefusedSettings, Configuration) {
    const auto status = [](auto change) {
        cairn_config config = {};
        config.struct_size = sizeof config;
        change(config);
        cairn_solver* made = reinterpret_cast<cairn_solver*>(1);
        const cairn_status result = cairn_solver_create(&config, &made);
        EXPECT_EQ(made == nullptr, result != CAIRN_OK);
        if (result == CAIRN_OK)
            cairn_solver_destroy(made);
        return result;
    };
    EXPECT_EQ(status([](cairn_config&) {}), CAIRN_OK);
    EXPECT_EQ(status([](cairn_config& c) { c.backend = CAIRN_BACKEND_CPU; }), CAIRN_OK);
    EXPECT_EQ(status([](cairn_config& c) { c.precision = 32; }), CAIRN_OK);
    EXPECT_EQ(status([](cairn_config& c) { c.precision = 64; }), CAIRN_OK);
    EXPECT_EQ(status([](cairn_config& c) { c.instructions = CAIRN_ISA_SCALAR; }), CAIRN_OK);
    cairn_info info = {};
    info.struct_size = sizeof info;
    ASSERT_EQ(cairn_get_info(&info), CAIRN_OK);
    const auto on_cuda = [](cairn_config& c) { c.backend = CAIRN_BACKEND_CUDA; };
    if (std::string(info.cuda).rfind("present", 0) == 0) {
        EXPECT_EQ(status(on_cuda), CAIRN_OK);
    } else {
        EXPECT_EQ(status(on_cuda), CAIRN_ERROR_UNSUPPORTED);
        EXPECT_TRUE(says("config.backend is CAIRN_BACKEND_CUDA, but ") && says(info.cuda) && says("CAIRN_BACKEND_AUTO"))
            << cairn_last_error();
    }
    ASSERT_EQ(setenv("CAIRN_BACKEND", "gpu", 1), 0);
    EXPECT_EQ(status([](cairn_config&) {}), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("CAIRN_BACKEND is \"gpu\"")) << cairn_last_error();
    EXPECT_EQ(status([](cairn_config& c) { c.backend = CAIRN_BACKEND_CPU; }), CAIRN_OK); // who asks is not overruled
    ASSERT_EQ(setenv("CAIRN_BACKEND", "cuda", 1), 0);
    EXPECT_EQ(status([](cairn_config& c) { c.precision = 64; }), CAIRN_OK);
    EXPECT_EQ(status([](cairn_config&) {}), status(on_cuda));
    ASSERT_EQ(unsetenv("CAIRN_BACKEND"), 0);
    EXPECT_EQ(status([](cairn_config& c) { c.executor = 4; }), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("config.executor is 4")) << cairn_last_error();
    EXPECT_EQ(status([](cairn_config& c) { c.reserved_2 = 1; }), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(status([](cairn_config& c) { c.backend = 3; }), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("config.backend is 3")) << cairn_last_error();
    EXPECT_EQ(status([](cairn_config& c) { c.threads = 1025; }), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("config.threads is 1025")) << cairn_last_error();
    EXPECT_EQ(status([](cairn_config& c) { c.precision = 16; }), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("config.precision is 16")) << cairn_last_error();
    EXPECT_EQ(status([](cairn_config& c) { c.instructions = 5; }), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("config.instructions is 5")) << cairn_last_error();
    EXPECT_EQ(status([](cairn_config& c) { c.reserved = 1; }), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(status([](cairn_config& c) { c.allocate = [](void*, size_t, size_t) -> void* { return nullptr; }; }),
              CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says("config.release is NULL")) << cairn_last_error();
    EXPECT_EQ(status([](cairn_config& c) { c.struct_size = 5000; }), CAIRN_ERROR_STRUCT_SIZE);
    EXPECT_EQ(cairn_solver_create(nullptr, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
    for (std::uint32_t isa = 1; isa <= CAIRN_ISA_AVX512; ++isa)
        EXPECT_EQ(status([isa](cairn_config& c) { c.instructions = isa; }), isa <= info.instructions ? CAIRN_OK : CAIRN_ERROR_UNSUPPORTED);
}

TEST_F(RefusedSettings, CopiesOutSayHowMuchTheyNeed) {
    size_t size = 0;
    ASSERT_EQ(cairn_solver_save_cache(solver, nullptr, 0, &size), CAIRN_OK) << cairn_last_error();
    ASSERT_GT(size, 0u);
    std::vector<unsigned char> blob(size, 0xab);
    size_t again = 0;
    EXPECT_EQ(cairn_solver_save_cache(solver, blob.data(), size - 1, &again), CAIRN_ERROR_BUFFER_TOO_SMALL);
    EXPECT_TRUE(says(std::to_string(size).c_str())) << cairn_last_error();
    EXPECT_EQ(again, size);
    EXPECT_EQ(blob, std::vector<unsigned char>(size, 0xab));
    EXPECT_EQ(cairn_solver_save_cache(solver, blob.data(), size, &again), CAIRN_OK);
    EXPECT_EQ(cairn_solver_load_cache(solver, blob.data(), size), CAIRN_OK) << cairn_last_error();
    EXPECT_EQ(cairn_solver_load_cache(solver, blob.data(), size - 1), CAIRN_ERROR_INVALID_DATA);
    EXPECT_TRUE(says("bytes")) << cairn_last_error();
    EXPECT_EQ(cairn_solver_load_cache(solver, nullptr, size), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(cairn_solver_save_cache(solver, blob.data(), size, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(cairn_solver_residual_trace(solver, nullptr, 0, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(cairn_solver_split_counts(nullptr, nullptr, 0, &size), CAIRN_ERROR_INVALID_ARGUMENT);
    cairn_statistics statistics = {};
    EXPECT_EQ(cairn_solver_get_statistics(solver, &statistics), CAIRN_ERROR_STRUCT_SIZE);
    statistics.struct_size = sizeof statistics;
    EXPECT_EQ(cairn_solver_get_statistics(solver, &statistics), CAIRN_OK);
}

TEST_F(RefusedSettings, NamesAndTable) {
    EXPECT_STREQ(cairn_status_name(CAIRN_ERROR_INVALID_DATA), "invalid data");
    for (cairn_status status = 0; status <= CAIRN_ERROR_INTERNAL; ++status)
        EXPECT_NE(cairn_status_name(status), nullptr);
    EXPECT_EQ(cairn_status_name(-1), nullptr);
    EXPECT_EQ(cairn_status_name(9), nullptr);
    EXPECT_STREQ(cairn_method_name(CAIRN_METHOD_TJSOFT), "tjsoft");
    EXPECT_EQ(cairn_method_name(CAIRN_METHOD_COUNT), nullptr);
    EXPECT_EQ(cairn_get_api(CAIRN_ABI_VERSION + 1), nullptr);
    const cairn_api* api = cairn_get_api(CAIRN_ABI_VERSION);
    ASSERT_NE(api, nullptr);
    EXPECT_EQ(api->struct_size, sizeof *api);
    EXPECT_EQ(api->solver_load_cache, &cairn_solver_load_cache);
    EXPECT_STREQ(cairn_method_name(CAIRN_METHOD_AUTO), "auto");
    EXPECT_EQ(cairn_reason_text(CAIRN_REASON_SLENDER + 1), nullptr);
    EXPECT_EQ(api->solver_choices, &cairn_solver_choices); // the last entry
    std::uint32_t axes[6];
    ASSERT_EQ(cairn_joint_axes(CAIRN_JOINT_HINGE, axes), CAIRN_OK);
    EXPECT_EQ(axes[4], CAIRN_AXIS_LOCKED);
    EXPECT_EQ(axes[5], CAIRN_AXIS_FREE);
    EXPECT_EQ(cairn_joint_axes(4, axes), CAIRN_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(cairn_joint_axes(0, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
}

TEST_F(RefusedSettings, TheTextIsTheThreadsOwn) {
    EXPECT_EQ(cairn_joint_axes(4, nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
    const std::string mine = cairn_last_error();
    std::thread([] {
        EXPECT_STREQ(cairn_last_error(), "");
        EXPECT_EQ(cairn_get_info(nullptr), CAIRN_ERROR_INVALID_ARGUMENT);
    }).join();
    EXPECT_EQ(mine, cairn_last_error());
    cairn_info info = {};
    info.struct_size = sizeof info;
    EXPECT_EQ(cairn_get_info(&info), CAIRN_OK);
    EXPECT_EQ(mine, cairn_last_error()); // a call that succeeds leaves it
}
