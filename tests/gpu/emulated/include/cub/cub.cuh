// The device-wide scans and sorts of CUB that Cairn may use. They ask for temporary memory as CUB does, are operations of a stream,
// and spoil the temporary memory, so that data kept there shows.
#pragma once
#include "../cuda/functional"
#include "../cuda_runtime.h"
#include <algorithm>
#include <cstring>
#include <numeric>
#include <type_traits>
#include <vector>

namespace cairn_emulated {
// One call of a device-wide function: counted, and refused if it is not called as it must be.
cudaError_t enqueue_cub(void* temporary, size_t bytes, size_t needed, cudaStream_t stream, std::function<void()> work);
bool in_device_memory(const void* pointer, size_t bytes);

template <class It> bool readable(It it, size_t count) {
    if constexpr (std::is_pointer_v<It>)
        return in_device_memory(it, count * sizeof *it);
    return true;
}

// Scans pieces on their own and then adds what came before, as a device does: an operator that is not associative shows.
template <class In, class Out, class Op, class Count>
cudaError_t scan(void* temporary, size_t& bytes, In in, Out out, Op op, Count items, bool inclusive, cudaStream_t stream) {
    using Value = std::decay_t<decltype(op(*in, *in))>;
    const size_t count = static_cast<size_t>(items), needed = 1024 + count / 8;
    if (!temporary) {
        bytes = needed;
        return cudaSuccess;
    }
    if (items < 0 || !readable(in, count) || !readable(out, count))
        return cudaErrorInvalidValue;
    return enqueue_cub(temporary, bytes, needed, stream, [=] {
        Value before{}, piece{};
        for (size_t i = 0; i < count; i++) {
            const Value item = in[i];
            const bool first = i % 7 == 0;
            if (first && i > 0)
                before = i > 7 ? static_cast<Value>(op(before, piece)) : piece;
            const Value exclusive = first ? before : i > 7 ? static_cast<Value>(op(before, piece)) : piece;
            piece = first ? item : static_cast<Value>(op(piece, item));
            const Value result = !inclusive ? exclusive : i >= 7 ? static_cast<Value>(op(before, piece)) : piece;
            out[i] = static_cast<std::decay_t<decltype(out[i])>>(result);
        }
    });
}

template <class Key, class Value, class Count>
cudaError_t sort(void* temporary, size_t& bytes, const Key* keys_in, Key* keys_out, const Value* values_in, Value* values_out, Count items,
                 int begin_bit, int end_bit, cudaStream_t stream) {
    static_assert(std::is_unsigned_v<Key>, "only unsigned keys are emulated");
    const size_t count = static_cast<size_t>(items), needed = 1024 + count * (sizeof(Key) + (values_in ? sizeof(Value) : 0));
    if (!temporary) {
        bytes = needed;
        return cudaSuccess;
    }
    const bool apart = keys_in + count <= keys_out || keys_out + count <= keys_in;
    const bool values_apart = values_in + count <= values_out || values_out + count <= values_in;
    if (items < 0 || begin_bit < 0 || end_bit < begin_bit || end_bit > static_cast<int>(8 * sizeof(Key)) || !apart ||
        (values_in && !values_apart) || !readable(keys_in, count) || !readable(keys_out, count) ||
        (values_in && (!readable(values_in, count) || !readable(values_out, count))))
        return cudaErrorInvalidValue;
    return enqueue_cub(temporary, bytes, needed, stream, [=] {
        const int width = end_bit - begin_bit;
        const Key mask = width == 0 ? Key(0) : static_cast<Key>(static_cast<Key>(~Key(0)) >> (static_cast<int>(8 * sizeof(Key)) - width));
        const auto digits = [=](Key key) { return width == 0 ? Key(0) : static_cast<Key>(static_cast<Key>(key >> begin_bit) & mask); };
        std::vector<size_t> order(count);
        std::iota(order.begin(), order.end(), size_t(0));
        std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return digits(keys_in[a]) < digits(keys_in[b]); });
        for (size_t i = 0; i < count; i++) {
            keys_out[i] = keys_in[order[i]];
            if (values_in)
                values_out[i] = values_in[order[i]];
        }
    });
}

struct Plus {
    template <class T> constexpr auto operator()(const T& a, const T& b) const { return a + b; }
};
} // namespace cairn_emulated

namespace cub {
struct DeviceScan {
    template <class In, class Out, class Count>
    static cudaError_t ExclusiveSum(void* d_temp_storage, size_t& temp_storage_bytes, In d_in, Out d_out, Count num_items,
                                    cudaStream_t stream = nullptr) {
        return cairn_emulated::scan(d_temp_storage, temp_storage_bytes, d_in, d_out, cairn_emulated::Plus(), num_items, false, stream);
    }
    template <class In, class Out, class Count>
    static cudaError_t InclusiveSum(void* d_temp_storage, size_t& temp_storage_bytes, In d_in, Out d_out, Count num_items,
                                    cudaStream_t stream = nullptr) {
        return cairn_emulated::scan(d_temp_storage, temp_storage_bytes, d_in, d_out, cairn_emulated::Plus(), num_items, true, stream);
    }
    template <class In, class Out, class Op, class Count>
    static cudaError_t InclusiveScan(void* d_temp_storage, size_t& temp_storage_bytes, In d_in, Out d_out, Op scan_op, Count num_items,
                                     cudaStream_t stream = nullptr) {
        return cairn_emulated::scan(d_temp_storage, temp_storage_bytes, d_in, d_out, scan_op, num_items, true, stream);
    }
};

struct DeviceRadixSort {
    template <class Key, class Value, class Count>
    static cudaError_t SortPairs(void* d_temp_storage, size_t& temp_storage_bytes, const Key* d_keys_in, Key* d_keys_out,
                                 const Value* d_values_in, Value* d_values_out, Count num_items, int begin_bit = 0,
                                 int end_bit = sizeof(Key) * 8, cudaStream_t stream = nullptr) {
        return cairn_emulated::sort(d_temp_storage, temp_storage_bytes, d_keys_in, d_keys_out, d_values_in, d_values_out, num_items,
                                    begin_bit, end_bit, stream);
    }
    template <class Key, class Count>
    static cudaError_t SortKeys(void* d_temp_storage, size_t& temp_storage_bytes, const Key* d_keys_in, Key* d_keys_out, Count num_items,
                                int begin_bit = 0, int end_bit = sizeof(Key) * 8, cudaStream_t stream = nullptr) {
        return cairn_emulated::sort<Key, Key>(d_temp_storage, temp_storage_bytes, d_keys_in, d_keys_out, nullptr, nullptr, num_items,
                                              begin_bit, end_bit, stream);
    }
};
} // namespace cub
