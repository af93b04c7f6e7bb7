#include "sanguine/stack.hpp"

#include <cmath>
#include <stdexcept>

#include "message.hpp"

namespace sanguine {
namespace {

[[noreturn]] void refuse(std::size_t layer, const char* key, double value, const char* allowed) {
    throw std::invalid_argument(message("layers.", layer, ".", key, ": ", value, " is not ", allowed));
}

}  // namespace

void check_stack(std::span<const Layer> stack) {
    if (stack.empty() || stack.size() > max_layers)
        throw std::invalid_argument("layers: " + std::to_string(stack.size()) + " of them, allowed are 1 to "
                                    + std::to_string(max_layers));
    for (std::size_t i = 0; i < stack.size(); ++i) {
        const Layer& layer = stack[i];
        // Written so that NaN is refused too.
        if (!(layer.mu_a >= 0 && layer.mu_a <= 1e7))
            refuse(i, "mu_a", layer.mu_a, "within 0 to 1e7 per mm");
        if (!(layer.mu_s >= 0 && layer.mu_s <= 1e7))
            refuse(i, "mu_s", layer.mu_s, "within 0 to 1e7 per mm");
        if (!(layer.g > -1 && layer.g < 1))
            refuse(i, "g", layer.g, "between -1 and 1");
        if (!(layer.n >= 1 && layer.n <= 4))
            refuse(i, "n", layer.n, "within 1 to 4");
        // Beyond any layer there is, and what it is times mu_a and mu_s has to be a number.
        if (!(layer.thickness > 0 && (layer.thickness <= 1e100 || std::isinf(layer.thickness))))
            refuse(i, "thickness", layer.thickness, "above 0 and up to 1e100 mm, or infinite");
        if (std::isinf(layer.thickness) && i + 1 != stack.size())
            throw std::invalid_argument("layers." + std::to_string(i)
                                        + ".thickness: only the last layer can be semi-infinite");
    }
}

}  // namespace sanguine
