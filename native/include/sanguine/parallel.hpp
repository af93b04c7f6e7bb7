// A loop over threads that can be watched and stopped.
#pragma once

#include <cstddef>
#include <functional>
#include <stdexcept>

namespace sanguine {

/// Asked on the calling thread a few times a second; false stops the work.
using Progress = std::function<bool(std::size_t done, std::size_t total)>;

/// Thrown by work that its Progress stopped.
struct Cancelled : std::runtime_error {
    Cancelled() : std::runtime_error("cancelled") {}
};

/// Runs body(i) for every i below `count` on `threads` threads (0: one per core). Rethrows the first exception of a
/// body, or throws Cancelled, after all threads have ended.
void parallel_for(std::size_t count, int threads, const Progress& progress,
                  const std::function<void(std::size_t)>& body);

}  // namespace sanguine
