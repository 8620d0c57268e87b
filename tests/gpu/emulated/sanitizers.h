// Which sanitizer this is built with.
#pragma once

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define CAIRN_ASAN 1
#endif
#if __has_feature(thread_sanitizer)
#define CAIRN_TSAN 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__)
#define CAIRN_ASAN 1
#endif
#if defined(__SANITIZE_THREAD__)
#define CAIRN_TSAN 1
#endif

#ifdef CAIRN_ASAN
#include <sanitizer/asan_interface.h>
#include <sanitizer/common_interface_defs.h>
#else
#define CAIRN_ASAN 0
#endif
#ifdef CAIRN_TSAN
#include <sanitizer/tsan_interface.h>
#else
#define CAIRN_TSAN 0
#endif
