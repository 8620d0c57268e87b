// Tests that run once a method of the paper: derive a fixture from EachMethod and instantiate it with CAIRN_EACH_METHOD.
#pragma once
#include "scene.h"

#include <gtest/gtest.h>

namespace cairn_test {

class EachMethod : public testing::TestWithParam<std::uint32_t> {};

inline std::string method_test_name(const testing::TestParamInfo<std::uint32_t>& method) { return cairn_method_name(method.param); }

#define CAIRN_EACH_METHOD(fixture) INSTANTIATE_TEST_SUITE_P(Each, fixture, testing::Range(0u, CAIRN_METHOD_AUTO), method_test_name)

} // namespace cairn_test
