// One line of text for a warning or an error.
#pragma once

#include <sstream>
#include <string>

namespace sanguine {

/// The parts in a row, numbers with three digits.
std::string message(const auto&... parts) {
    std::ostringstream out;
    out.precision(3);
    (out << ... << parts);
    return out.str();
}

}  // namespace sanguine
