#include "sanguine/parallel.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace sanguine {

void parallel_for(std::size_t count, int threads, const Progress& progress,
                  const std::function<void(std::size_t)>& body) {
    if (threads < 0)
        throw std::invalid_argument("threads: " + std::to_string(threads) + " is below 0 (0: all cores)");
    const std::size_t wanted = threads > 0 ? threads : std::max(1U, std::thread::hardware_concurrency());
    // Beyond the largest machines' cores more threads only cost; a number by mistake must not exhaust the system.
    constexpr std::size_t most = 512;
    const std::size_t workers = std::min({count, wanted, most});

    std::atomic<std::size_t> next = 0, done = 0;
    std::atomic<bool> stop = false;
    std::mutex mutex;
    std::condition_variable ended;
    std::size_t running = workers;
    std::exception_ptr failure;

    const auto work = [&] {
        try {
            for (std::size_t i; !stop && (i = next++) < count; ++done)
                body(i);
        } catch (...) {
            stop = true;
            const std::lock_guard lock(mutex);
            if (!failure)
                failure = std::current_exception();
        }
        const std::lock_guard lock(mutex);
        --running;
        ended.notify_one();
    };

    if (workers == 1 && !progress) {
        work();
    } else {
        std::vector<std::jthread> pool;
        for (std::size_t t = 0; t < workers; ++t)
            pool.emplace_back(work);
        std::unique_lock lock(mutex);
        while (!ended.wait_for(lock, std::chrono::milliseconds(200), [&] { return running == 0; })) {
            if (!progress)
                continue;
            lock.unlock();
            try {
                if (!progress(done, count))
                    stop = true;
            } catch (...) {
                stop = true;  // the pool is joined while the caller's exception passes
                throw;
            }
            lock.lock();
        }
    }
    if (failure)
        std::rethrow_exception(failure);
    if (done < count)
        throw Cancelled();
    if (progress)
        progress(count, count);
}

}  // namespace sanguine
