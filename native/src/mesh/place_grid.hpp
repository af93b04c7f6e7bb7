// Finds the items (spots, pieces of vessels) whose box holds a place.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

namespace sanguine {

/// A table of the cells of space that items touch. A place costs one look-up, whatever the number of items.
class PlaceGrid {
public:
    struct Box {
        glm::vec3 low, high;
    };

    PlaceGrid() = default;
    /// Items are numbered as in `boxes`. Boxes of about the same size are best; one may be a good deal larger.
    explicit PlaceGrid(std::span<const Box> boxes);

    /// All items whose box holds the place, and some more; ascending. Valid as long as the grid.
    std::span<const std::uint32_t> at(glm::vec3 place_mm) const;

private:
    struct Slot {
        glm::ivec3 cell;
        std::uint32_t first, end;  // in items_; empty: free
    };
    std::size_t slot_of(glm::ivec3 cell) const;
    glm::ivec3 cell_of(glm::vec3 place_mm) const;

    float cell_mm_ = 1;
    std::vector<Slot> slots_;  // an open hash table, its size a power of two
    std::vector<std::uint32_t> items_;
};

}  // namespace sanguine
