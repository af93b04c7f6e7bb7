// A file that appears whole or not at all.
#pragma once

#ifdef _WIN32
#include <process.h>
#else
#include <unistd.h>
#endif

#include <atomic>
#include <filesystem>
#include <sstream>

#include "sanguine/image.hpp"

namespace sanguine {

#ifdef _WIN32
inline int getpid() { return _getpid(); }
#endif

/// Write to temporary(), then commit(). Without a commit nothing is left behind.
class AtomicFile {
public:
    explicit AtomicFile(std::filesystem::path path) : path_(std::move(path)) {
        // In the same folder, because a rename across file systems is a copy; with the same extension, because
        // OpenImageIO chooses the format by it.
        static std::atomic<unsigned> counter{0};
        std::ostringstream name;
        name << '.' << path_.stem().string() << '.' << getpid() << '-' << counter++ << ".tmp"
             << path_.extension().string();
        temporary_ = path_;
        temporary_.replace_filename(name.str());
    }
    ~AtomicFile() {
        std::error_code ignored;  // after a commit there is nothing to remove
        std::filesystem::remove(temporary_, ignored);
    }
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    const std::filesystem::path& temporary() const { return temporary_; }

    void commit() {
        std::error_code error;
        std::filesystem::rename(temporary_, path_, error);
        if (error) throw ImageError(path_, "cannot be written: " + error.message());
    }

private:
    std::filesystem::path path_;
    std::filesystem::path temporary_;
};

}  // namespace sanguine
