// What the device says of itself, and the texts of errors.
#include "state.h"
#include <cstring>

using namespace cairn_emulated;

cudaError_t cudaGetDeviceCount(int* count) {
    if (!count)
        return remember(cudaErrorInvalidValue);
    *count = 0;
    return api_call([&] {
        *count = 1;
        return cudaSuccess;
    });
}
cudaError_t cudaSetDevice(int device) {
    return api_call([&] { return device == 0 ? cudaSuccess : cudaErrorInvalidDevice; });
}
cudaError_t cudaGetDevice(int* device) {
    return api_call([&] {
        *device = 0;
        return cudaSuccess;
    });
}

cudaError_t cudaGetDeviceProperties(cudaDeviceProp* prop, int device) {
    return api_call([&] {
        if (!prop || device != 0)
            return device != 0 ? cudaErrorInvalidDevice : cudaErrorInvalidValue;
        const Properties& p = state.properties;
        *prop = {};
        std::strncpy(prop->name, p.name.c_str(), sizeof prop->name - 1);
        size_t free = 0;
        if (const cudaError_t error = cudaMemGetInfo(&free, &prop->totalGlobalMem); error != cudaSuccess)
            return error;
        prop->sharedMemPerBlock = p.shared_per_block;
        prop->regsPerBlock = prop->regsPerMultiprocessor = p.registers_per_multiprocessor;
        prop->warpSize = 32;
        prop->maxThreadsPerBlock = prop->maxThreadsDim[0] = prop->maxThreadsDim[1] = p.threads_per_block;
        prop->maxThreadsDim[2] = 64;
        prop->maxGridSize[0] = 0x7fffffff;
        prop->maxGridSize[1] = prop->maxGridSize[2] = 65535;
        prop->major = p.compute_major;
        prop->minor = p.compute_minor;
        prop->multiProcessorCount = p.multiprocessors;
        prop->unifiedAddressing = 1;
        prop->l2CacheSize = p.l2_bytes;
        prop->maxThreadsPerMultiProcessor = p.threads_per_multiprocessor;
        prop->sharedMemPerMultiprocessor = p.shared_per_multiprocessor;
        prop->cooperativeLaunch = p.cooperative_launch;
        prop->sharedMemPerBlockOptin = p.shared_per_block_optin;
        prop->maxBlocksPerMultiProcessor = p.blocks_per_multiprocessor;
        prop->reservedSharedMemPerBlock = p.shared_reserved_per_block;
        prop->clusterLaunch = p.cluster_launch;
        return cudaSuccess;
    });
}

cudaError_t cudaDeviceGetAttribute(int* value, cudaDeviceAttr attr, int device) {
    return api_call([&] {
        if (!value || device != 0)
            return device != 0 ? cudaErrorInvalidDevice : cudaErrorInvalidValue;
        const Properties& p = state.properties;
        switch (attr) {
        case cudaDevAttrMaxThreadsPerBlock:
            *value = p.threads_per_block;
            break;
        case cudaDevAttrMaxSharedMemoryPerBlock:
            *value = static_cast<int>(p.shared_per_block);
            break;
        case cudaDevAttrWarpSize:
            *value = 32;
            break;
        case cudaDevAttrMultiProcessorCount:
            *value = p.multiprocessors;
            break;
        case cudaDevAttrL2CacheSize:
            *value = p.l2_bytes;
            break;
        case cudaDevAttrMaxThreadsPerMultiProcessor:
            *value = p.threads_per_multiprocessor;
            break;
        case cudaDevAttrUnifiedAddressing:
            *value = 1;
            break;
        case cudaDevAttrComputeCapabilityMajor:
            *value = p.compute_major;
            break;
        case cudaDevAttrComputeCapabilityMinor:
            *value = p.compute_minor;
            break;
        case cudaDevAttrMaxSharedMemoryPerMultiprocessor:
            *value = static_cast<int>(p.shared_per_multiprocessor);
            break;
        case cudaDevAttrMaxRegistersPerMultiprocessor:
            *value = p.registers_per_multiprocessor;
            break;
        case cudaDevAttrCooperativeLaunch:
            *value = p.cooperative_launch;
            break;
        case cudaDevAttrMaxSharedMemoryPerBlockOptin:
            *value = static_cast<int>(p.shared_per_block_optin);
            break;
        case cudaDevAttrMaxBlocksPerMultiprocessor:
            *value = p.blocks_per_multiprocessor;
            break;
        case cudaDevAttrReservedSharedMemoryPerBlock:
            *value = static_cast<int>(p.shared_reserved_per_block);
            break;
        case cudaDevAttrClusterLaunch:
            *value = p.cluster_launch;
            break;
        default:
            return cudaErrorInvalidValue;
        }
        return cudaSuccess;
    });
}

cudaError_t cudaDriverGetVersion(int* version) {
    *version = state.presence == Presence::no_driver ? 0 : state.properties.driver_version;
    return cudaSuccess;
}
cudaError_t cudaRuntimeGetVersion(int* version) {
    *version = CUDART_VERSION;
    return cudaSuccess;
}

const char* cudaGetErrorName(cudaError_t error) {
    switch (error) {
#define CAIRN_EMULATED_NAME(name)                                                                                                          \
    case name:                                                                                                                             \
        return #name;
        CAIRN_EMULATED_NAME(cudaSuccess)
        CAIRN_EMULATED_NAME(cudaErrorInvalidValue)
        CAIRN_EMULATED_NAME(cudaErrorMemoryAllocation)
        CAIRN_EMULATED_NAME(cudaErrorInvalidConfiguration)
        CAIRN_EMULATED_NAME(cudaErrorInvalidMemcpyDirection)
        CAIRN_EMULATED_NAME(cudaErrorInsufficientDriver)
        CAIRN_EMULATED_NAME(cudaErrorInvalidDeviceFunction)
        CAIRN_EMULATED_NAME(cudaErrorNoDevice)
        CAIRN_EMULATED_NAME(cudaErrorInvalidDevice)
        CAIRN_EMULATED_NAME(cudaErrorInvalidResourceHandle)
        CAIRN_EMULATED_NAME(cudaErrorNotReady)
        CAIRN_EMULATED_NAME(cudaErrorIllegalAddress)
        CAIRN_EMULATED_NAME(cudaErrorLaunchOutOfResources)
        CAIRN_EMULATED_NAME(cudaErrorLaunchFailure)
        CAIRN_EMULATED_NAME(cudaErrorCooperativeLaunchTooLarge)
        CAIRN_EMULATED_NAME(cudaErrorNotSupported)
        CAIRN_EMULATED_NAME(cudaErrorStreamCaptureUnsupported)
        CAIRN_EMULATED_NAME(cudaErrorStreamCaptureInvalidated)
        CAIRN_EMULATED_NAME(cudaErrorStreamCaptureMerge)
        CAIRN_EMULATED_NAME(cudaErrorStreamCaptureUnmatched)
        CAIRN_EMULATED_NAME(cudaErrorStreamCaptureUnjoined)
        CAIRN_EMULATED_NAME(cudaErrorStreamCaptureIsolation)
        CAIRN_EMULATED_NAME(cudaErrorStreamCaptureImplicit)
        CAIRN_EMULATED_NAME(cudaErrorCapturedEvent)
        CAIRN_EMULATED_NAME(cudaErrorStreamCaptureWrongThread)
        CAIRN_EMULATED_NAME(cudaErrorInvalidClusterSize)
        CAIRN_EMULATED_NAME(cudaErrorUnknown)
#undef CAIRN_EMULATED_NAME
    }
    return "unrecognized error code";
}
const char* cudaGetErrorString(cudaError_t error) {
    switch (error) {
    case cudaSuccess:
        return "no error";
    case cudaErrorMemoryAllocation:
        return "out of memory";
    case cudaErrorNoDevice:
        return "no CUDA-capable device is detected";
    case cudaErrorInsufficientDriver:
        return "CUDA driver version is insufficient for CUDA runtime version";
    case cudaErrorIllegalAddress:
        return "an illegal memory access was encountered";
    default:
        return cudaGetErrorName(error);
    }
}
