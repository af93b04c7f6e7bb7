#include "place_grid.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

#include <glm/common.hpp>

namespace sanguine {

PlaceGrid::PlaceGrid(std::span<const Box> boxes) {
    if (boxes.empty()) return;
    double sum = 0;
    float largest = 0;
    for (const Box& box : boxes) {
        const glm::vec3 size = box.high - box.low;
        const float extent = std::max({size.x, size.y, size.z});
        sum += extent;
        largest = std::max(largest, extent);
    }
    // An item of the mean size touches some eight cells, the largest at most nine in each direction.
    cell_mm_ = std::max({float(sum / double(boxes.size())), largest / 8, 1e-3F});

    struct Entry {
        glm::ivec3 cell;
        std::uint32_t item;
    };
    std::vector<Entry> entries;
    for (std::uint32_t i = 0; i < boxes.size(); ++i) {
        const glm::ivec3 low = cell_of(boxes[i].low), high = cell_of(boxes[i].high);
        for (int z = low.z; z <= high.z; ++z)
            for (int y = low.y; y <= high.y; ++y)
                for (int x = low.x; x <= high.x; ++x) entries.push_back({{x, y, z}, i});
    }
    std::ranges::sort(entries, {}, [](const Entry& e) { return std::tuple(e.cell.z, e.cell.y, e.cell.x, e.item); });

    items_.reserve(entries.size());
    std::vector<Slot> cells;
    for (const Entry& entry : entries) {
        const auto at = std::uint32_t(items_.size());
        if (cells.empty() || cells.back().cell != entry.cell) cells.push_back({entry.cell, at, at});
        items_.push_back(entry.item);
        cells.back().end = at + 1;
    }
    slots_.assign(std::bit_ceil(2 * cells.size()), Slot{});
    for (const Slot& cell : cells) slots_[slot_of(cell.cell)] = cell;
}

glm::ivec3 PlaceGrid::cell_of(glm::vec3 place_mm) const { return glm::ivec3(glm::floor(place_mm / cell_mm_)); }

/// The slot of the cell, or the free one where it would be.
std::size_t PlaceGrid::slot_of(glm::ivec3 cell) const {
    std::uint32_t h = std::uint32_t(cell.x) * 0x8da6b343U ^ std::uint32_t(cell.y) * 0xd8163841U ^
                      std::uint32_t(cell.z) * 0xcb1ab31fU;
    h = (h ^ (h >> 16)) * 0x85ebca6bU;
    std::size_t i = (h ^ (h >> 13)) & (slots_.size() - 1);
    while (slots_[i].first != slots_[i].end && slots_[i].cell != cell) i = (i + 1) & (slots_.size() - 1);
    return i;
}

std::span<const std::uint32_t> PlaceGrid::at(glm::vec3 place_mm) const {
    if (slots_.empty()) return {};
    const Slot& slot = slots_[slot_of(cell_of(place_mm))];
    return std::span(items_).subspan(slot.first, slot.end - slot.first);
}

}  // namespace sanguine
