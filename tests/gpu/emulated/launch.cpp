// Which launches a device takes, and how many blocks of a kernel fit it.
#include "kernel.h"
#include "streams.h"
#include <algorithm>
#include <map>

namespace cairn_emulated {
namespace {
struct Function {
    int max_dynamic_shared = -1; // -1: the device's default
    bool any_cluster_size = false;
};
std::map<const void*, Function> functions;

size_t dynamic_limit(const void* address) {
    const auto it = functions.find(address);
    return it == functions.end() || it->second.max_dynamic_shared < 0 ? state.properties.shared_per_block
                                                                      : static_cast<size_t>(it->second.max_dynamic_shared);
}

int blocks_per_multiprocessor(const void* address, size_t threads, size_t dynamic_shared) {
    const Properties& p = state.properties;
    if (threads == 0 || threads > static_cast<size_t>(p.threads_per_block) || dynamic_shared > dynamic_limit(address))
        return 0;
    const size_t whole_warps = (threads + 31) / 32 * 32;
    size_t blocks = static_cast<size_t>(p.blocks_per_multiprocessor);
    blocks = std::min(blocks, static_cast<size_t>(p.threads_per_multiprocessor) / whole_warps);
    blocks =
        std::min(blocks, static_cast<size_t>(p.registers_per_multiprocessor) / (whole_warps * static_cast<size_t>(p.registers_per_thread)));
    blocks = std::min(blocks, p.shared_per_multiprocessor / (dynamic_shared + p.shared_reserved_per_block));
    return static_cast<int>(blocks);
}

size_t volume(const dim3& d) { return size_t(d.x) * d.y * d.z; }

cudaError_t read_attributes(const cudaLaunchConfig_t& config, Launch& launch) {
    if (config.numAttrs > 0 && !config.attrs)
        return cudaErrorInvalidValue;
    for (unsigned i = 0; i < config.numAttrs; i++) {
        const cudaLaunchAttribute& attribute = config.attrs[i];
        switch (attribute.id) {
        case cudaLaunchAttributeIgnore:
            break;
        case cudaLaunchAttributeCooperative:
            launch.cooperative = attribute.val.cooperative != 0;
            break;
        case cudaLaunchAttributeClusterDimension:
            launch.cluster = dim3(attribute.val.clusterDim.x, attribute.val.clusterDim.y, attribute.val.clusterDim.z);
            break;
        default:
            return cudaErrorInvalidValue;
        }
    }
    return cudaSuccess;
}

cudaError_t check(const Launch& launch) {
    const Properties& p = state.properties;
    const dim3 &grid = launch.grid, &block = launch.block, &cluster = launch.cluster;
    if (volume(grid) == 0 || volume(block) == 0 || grid.x > 0x7fffffffu || grid.y > 65535 || grid.z > 65535 || block.z > 64 ||
        volume(block) > static_cast<size_t>(p.threads_per_block) || volume(grid) > 0xffffffffu)
        return cudaErrorInvalidConfiguration;
    if (launch.shared_bytes > dynamic_limit(launch.kernel.address))
        return cudaErrorInvalidValue;
    const int resident = blocks_per_multiprocessor(launch.kernel.address, volume(block), launch.shared_bytes);
    if (resident == 0)
        return cudaErrorLaunchOutOfResources;
    if (volume(cluster) == 0 || (volume(cluster) > 1 && !p.cluster_launch))
        return cudaErrorNotSupported;
    const auto function = functions.find(launch.kernel.address);
    if (volume(cluster) > (function != functions.end() && function->second.any_cluster_size ? 16u : 8u))
        return cudaErrorInvalidClusterSize;
    if (grid.x % cluster.x || grid.y % cluster.y || grid.z % cluster.z)
        return cudaErrorInvalidConfiguration;
    const size_t at_once = static_cast<size_t>(resident) * static_cast<size_t>(p.multiprocessors);
    if (volume(cluster) > at_once)
        return cudaErrorInvalidClusterSize;
    if (launch.cooperative && !p.cooperative_launch)
        return cudaErrorNotSupported;
    return launch.cooperative && volume(grid) > at_once / volume(cluster) * volume(cluster) ? cudaErrorCooperativeLaunchTooLarge
                                                                                            : cudaSuccess;
}
} // namespace

cudaError_t launch(const cudaLaunchConfig_t& config, Kernel kernel) {
    return api_call([&] {
        if (!kernel.address)
            return cudaErrorInvalidDeviceFunction;
        Launch launch{std::move(kernel), config.gridDim, config.blockDim, dim3(1), config.dynamicSmemBytes, false};
        if (const cudaError_t error = read_attributes(config, launch); error != cudaSuccess)
            return error;
        if (const cudaError_t error = check(launch); error != cudaSuccess)
            return error;
        state.counters.launches++;
        return enqueue(config.stream, [launch = std::make_shared<const Launch>(std::move(launch))] { run_kernel(*launch); });
    });
}
} // namespace cairn_emulated

using namespace cairn_emulated;

cudaError_t cudaFuncSetAttribute(const void* func, cudaFuncAttribute attr, int value) {
    return api_call([&] {
        switch (attr) {
        case cudaFuncAttributeMaxDynamicSharedMemorySize:
            if (value < 0 || static_cast<size_t>(value) > state.properties.shared_per_block_optin)
                return cudaErrorInvalidValue;
            functions[func].max_dynamic_shared = value;
            return cudaSuccess;
        case cudaFuncAttributePreferredSharedMemoryCarveout:
            return value >= -1 && value <= 100 ? cudaSuccess : cudaErrorInvalidValue;
        case cudaFuncAttributeNonPortableClusterSizeAllowed:
            functions[func].any_cluster_size = value != 0;
            return cudaSuccess;
        }
        return cudaErrorInvalidValue;
    });
}

cudaError_t cudaFuncGetAttributes(cudaFuncAttributes* attr, const void* func) {
    return api_call([&] {
        if (!attr || !func)
            return cudaErrorInvalidValue;
        *attr = {};
        attr->maxThreadsPerBlock = state.properties.threads_per_block;
        attr->numRegs = state.properties.registers_per_thread;
        attr->ptxVersion = attr->binaryVersion = state.properties.compute_major * 10 + state.properties.compute_minor;
        attr->maxDynamicSharedSizeBytes = static_cast<int>(dynamic_limit(func));
        attr->nonPortableClusterSizeAllowed = functions[func].any_cluster_size;
        return cudaSuccess;
    });
}

cudaError_t cudaOccupancyMaxActiveBlocksPerMultiprocessor(int* numBlocks, const void* func, int blockSize, size_t dynamicSMemSize) {
    return api_call([&] {
        if (!numBlocks || !func || blockSize <= 0)
            return cudaErrorInvalidValue;
        *numBlocks = blocks_per_multiprocessor(func, static_cast<size_t>(blockSize), dynamicSMemSize);
        return cudaSuccess;
    });
}

cudaError_t cudaOccupancyMaxActiveClusters(int* numClusters, const void* func, const cudaLaunchConfig_t* config) {
    return api_call([&] {
        if (!numClusters || !func || !config)
            return cudaErrorInvalidValue;
        Launch launch{{func, nullptr, {}}, config->gridDim, config->blockDim, dim3(1), config->dynamicSmemBytes, false};
        if (const cudaError_t error = read_attributes(*config, launch); error != cudaSuccess)
            return error;
        const size_t cluster = volume(launch.cluster);
        if (cluster == 0 || !state.properties.cluster_launch)
            return cudaErrorNotSupported;
        if (cluster > (functions[func].any_cluster_size ? 16u : 8u))
            return cudaErrorInvalidClusterSize;
        const int blocks = blocks_per_multiprocessor(func, volume(launch.block), launch.shared_bytes) * state.properties.multiprocessors;
        *numClusters = blocks / static_cast<int>(cluster);
        return cudaSuccess;
    });
}
