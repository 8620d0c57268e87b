// Large arrays: aligned to cache lines, grown geometrically, through the caller's allocator if there is one.
#pragma once
#include "solver.h"

#include <algorithm>
#include <cstdlib>
#include <new>
#include <type_traits>
#include <utility>

namespace cairn {

template <class T> class Buffer {
    static_assert(std::is_trivially_copyable_v<T>);

  public:
    explicit Buffer(const Hooks& hooks) : hooks_(hooks) {}
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;
    ~Buffer() { release(); }

    // `size` elements, contents unspecified
    T* resize(std::size_t size) {
        if (size > capacity_) {
            const std::size_t capacity = std::max(size, capacity_ + capacity_ / 2);
            T* fresh = allocate(capacity);
            release();
            data_ = fresh;
            capacity_ = capacity;
        }
        size_ = size;
        return data_;
    }
    T* resize_filled(std::size_t size, T value) {
        resize(size);
        std::fill_n(data_, size, value);
        return data_;
    }
    T* data() { return data_; }
    const T* data() const { return data_; }
    std::size_t size() const { return size_; }
    T& operator[](std::size_t i) { return data_[i]; }
    const T& operator[](std::size_t i) const { return data_[i]; }
    T* begin() { return data_; }
    T* end() { return data_ + size_; }
    const T* begin() const { return data_; }
    const T* end() const { return data_ + size_; }

  private:
    static constexpr std::size_t kAlignment = 64;

    T* allocate(std::size_t count) {
        const std::size_t bytes = (count * sizeof(T) + kAlignment - 1) / kAlignment * kAlignment;
        void* memory = hooks_.allocate ? hooks_.allocate(hooks_.user, bytes, kAlignment) : std::aligned_alloc(kAlignment, bytes);
        if (!memory)
            throw std::bad_alloc();
        return static_cast<T*>(memory);
    }
    void release() {
        if (!data_)
            return;
        const std::size_t bytes = (capacity_ * sizeof(T) + kAlignment - 1) / kAlignment * kAlignment;
        if (hooks_.release)
            hooks_.release(hooks_.user, data_, bytes, kAlignment);
        else
            std::free(data_);
        data_ = nullptr;
        capacity_ = size_ = 0;
    }

    Hooks hooks_;
    T* data_ = nullptr;
    std::size_t size_ = 0, capacity_ = 0;
};

} // namespace cairn
