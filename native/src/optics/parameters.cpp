#include "sanguine/parameters.hpp"

#include <iterator>
#include <sstream>
#include <stdexcept>

namespace sanguine {

SkinParameters skin_from_row(std::span<const double> values, std::size_t index) {
    if (values.size() != std::size(parameter_rows))
        throw std::invalid_argument("skin " + std::to_string(index) + ": " + std::to_string(values.size())
                                    + " values, needs " + std::to_string(std::size(parameter_rows)));
    SkinParameters skin;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const ParameterRow& row = parameter_rows[i];
        if (!(values[i] >= row.hard_min && values[i] <= row.hard_max)) {  // also refuses a NaN
            std::ostringstream message;
            message << "skin " << index << ": " << row.id << ": " << values[i] << " is outside "
                    << row.hard_min << " to " << row.hard_max;
            if (row.unit != "1")
                message << ' ' << row.unit;
            throw std::invalid_argument(message.str());
        }
        skin.*row.field = values[i];
    }
    return skin;
}

}  // namespace sanguine
