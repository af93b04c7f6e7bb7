// What several tests ask of an error.
#pragma once

#include <stdexcept>
#include <string>

/// What the std::invalid_argument says, "" without one.
template <class Function> std::string message_of(Function&& function) {
    try {
        function();
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}
