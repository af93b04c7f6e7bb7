// How much of a wide sweep a test runs.
#pragma once

#include <cstddef>

namespace sanguine {

/// All cases, or every eleventh under the address sanitizer: what it looks for shows in each kind of case, and Eigen's
/// small matrices take it twenty times as long. A stride of 11 meets every value of grids of 2 to 10 values per axis.
#ifdef __SANITIZE_ADDRESS__
inline constexpr std::size_t sweep_stride = 11;
#else
inline constexpr std::size_t sweep_stride = 1;
#endif

}  // namespace sanguine
