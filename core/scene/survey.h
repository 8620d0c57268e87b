// The islands of a step before it is packed, and what each is made of: for the method `auto`.
#pragma once
#include "../method/choose.h"
#include "input.h"

#include <cstdint>
#include <vector>

namespace cairn {

// Islands in the order of their first bodies, as Scene numbers them.
class Survey {
  public:
    struct Island {
        std::uint32_t first_body;
        Features features;
        Reason reason;
    };

    void look(const Input& input);

    std::vector<Island> islands;
    std::vector<std::uint32_t> body_island; // kNone where the body cannot move

    static constexpr std::uint32_t kNone = 0xffffffffu;

  private:
    void measure_heights(const Input& input);

    std::vector<std::uint32_t> parent_, joined_;
    std::vector<std::uint32_t> first_, next_, neighbour_, height_, queue_;
};

// The islands of one kind, for a Scene to pack alone: the other bodies that can move, and what touches them, are left out.
struct Selection {
    const Survey* survey;
    Reason reason;

    bool holds(std::uint32_t body) const {
        const std::uint32_t island = survey->body_island[body];
        return island == Survey::kNone || survey->islands[island].reason == reason;
    }
};

} // namespace cairn
