// Work done since the last reset, so that tests can prove that an inactive effect did none.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

struct Counter {
    const char* name;
    std::atomic<std::uint64_t> count = 0;
};

struct Counters {
    Counter spectral_solves{"spectral_solves"};      ///< reflectances: skins x wavelengths
    Counter profile_solves{"profile_solves"};        ///< radial profiles: skins x wavelengths
    Counter lobe_fits{"lobe_fits"};                  ///< fits: skins x channels
    Counter stack_solves{"stack_solves"};            ///< layered stacks, whatever the solver
    Counter texels_rasterized{"texels_rasterized"};  ///< pixels of drawn maps, each channel once
    Counter texels_painted{"texels_painted"};        ///< places of maps, each feature once
    Counter spectra_fitted{"spectra_fitted"};        ///< measured spectra
    Counter texels_inverted{"texels_inverted"};      ///< texels of pictures

    std::array<Counter*, 8> all() {
        return {&spectral_solves,   &profile_solves, &lobe_fits,     &stack_solves,
                &texels_rasterized, &texels_painted, &spectra_fitted, &texels_inverted};
    }
};

inline Counters counters;
