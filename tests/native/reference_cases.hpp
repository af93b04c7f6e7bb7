// Independent Monte Carlo answers (double precision, Henyey-Greenstein, Fresnel at every boundary, 14 million photons
// or more), themselves checked against van de Hulst, Giovanelli and adding-doubling. Cases are named as in the
// project's reference set `public.json`; units mm and 1/mm.
#pragma once

#include <limits>
#include <vector>

#include "sanguine/photon_tracer.hpp"

namespace reference {

inline constexpr double half_space = std::numeric_limits<double>::infinity();

struct Case {
    const char* id;
    sanguine::Incidence incidence;
    std::vector<sanguine::Layer> layers;
    double scattered_reflectance, scattered_reflectance_se;  ///< left the top after at least one scattering
    double transmittance, transmittance_se;                  ///< all that left the bottom
};

inline const Case cases[] = {
    {"p02", sanguine::Incidence::normal,
     {{2.67507, 31.4012, 0.8, 1.4, 0.1}, {0.600805, 15.7006, 0.8, 1.4, half_space}}, 0.10650271, 4.45e-05, 0, 0},
    {"p06", sanguine::Incidence::normal,
     {{0.137249, 4.40428, 0.0, 1.4, 0.1}, {0.0340398, 2.20214, 0.0, 1.4, half_space}}, 0.52294628, 9.33e-05, 0, 0},
    {"p09", sanguine::Incidence::normal,
     {{1.0, 9.0, 0.75, 1.0, 0.2}}, 0.097383284, 1.6e-05, 0.66096407, 1.86e-05},
    {"p10", sanguine::Incidence::normal,
     {{0.1, 10.0, 0.8, 1.4, 0.01}}, 0.013706325, 4.02e-06, 0.9347882, 6.55e-06},
    {"p11", sanguine::Incidence::normal,
     {{10.0, 1.0, 0.0, 1.4, half_space}}, 0.0060353, 2.36e-06, 0, 0},
    {"p13", sanguine::Incidence::diffuse,
     {{2.14443, 28.1214, 0.8, 1.4, 0.06}, {0.583129, 14.0607, 0.8, 1.4, half_space}}, 0.12990401, 4.78e-05, 0, 0},
};

/// Energy of case p13 in rings between `inner` and `outer` [mm], per incident photon.
struct Ring {
    double inner, outer, fraction;
};

inline constexpr double p13_below_first_ring = 0.004919531999999999;
inline constexpr Ring p13_rings[] = {
    {0.01, 0.0120927688, 0.000942654},
    {0.0120927688, 0.0146235057, 0.00110355},
    {0.0146235057, 0.0176838674, 0.00130908},
    {0.0176838674, 0.021384692, 0.00152816},
    {0.021384692, 0.0258600136, 0.00176997},
    {0.0258600136, 0.0312719166, 0.00205767},
    {0.0312719166, 0.0378164058, 0.00235754},
    {0.0378164058, 0.0457305052, 0.00272685},
    {0.0457305052, 0.0553008427, 0.00310676},
    {0.0553008427, 0.0668740305, 0.0035319},
    {0.0668740305, 0.080869219, 0.00394082},
    {0.080869219, 0.0977932768, 0.00442387},
    {0.0977932768, 0.118259149, 0.00497302},
    {0.118259149, 0.143008055, 0.00549932},
    {0.143008055, 0.172936334, 0.0060803},
    {0.172936334, 0.209127911, 0.00668216},
    {0.209127911, 0.252893547, 0.00730428},
    {0.252893547, 0.30581832, 0.00791867},
    {0.30581832, 0.369819024, 0.00835177},
    {0.369819024, 0.447213596, 0.00858989},
    {0.447213596, 0.540805062, 0.00856484},
    {0.540805062, 0.653983058, 0.00813801},
    {0.653983058, 0.790846592, 0.00722966},
    {0.790846592, 0.9563525, 0.0059437},
    {0.9563525, 1.15649497, 0.00448877},
    {1.15649497, 1.39852263, 0.00303653},
    {1.39852263, 1.69120108, 0.00181772},
    {1.69120108, 2.04513036, 0.000946318},
    {2.04513036, 2.47312887, 0.000418345},
    {2.47312887, 2.99069756, 0.000149079},
    {2.99069756, 3.61658142, 4.20893e-05},
    {3.61658142, 4.3734483, 9.50533e-06},
    {4.3734483, 5.28870991, 1.57289e-06},
    {5.28870991, 6.39551462, 1.10595e-07},
    {6.39551462, 7.73394797, 9.05857e-09},
    {7.73394797, 9.35248448, 0.0},
    {9.35248448, 11.3097433, 0.0},
    {11.3097433, 13.676611, 0.0},
    {13.676611, 16.5388095, 0.0},
    {16.5388095, 20.0, 0.0},
};

}  // namespace reference
