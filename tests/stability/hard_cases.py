"""Stacks that break transport codes, each with the reason why it is here."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .extremes import METRE, NANOMETRE, Layer

INF = math.inf
DERMIS: Layer = (0.05, 12.0, 0.8, 1.4, INF)


@dataclass(frozen=True)
class HardCase:
    id: str
    why: str
    stack: tuple[Layer, ...]
    incidence: str = "normal"
    photons: int = 20_000


CASES = (
    HardCase("anatomical epidermis, red", "0.06 mm is thinner than one reduced mean free path: the normal case of a face",
             ((0.7, 22.0, 0.8, 1.4, 0.06), (0.04, 11.0, 0.8, 1.4, INF))),
    HardCase("anatomical epidermis, blue", "dark enough that diffusion ends, thin as above",
             ((4.0, 46.0, 0.8, 1.4, 0.05), (0.8, 23.0, 0.8, 1.4, INF))),
    HardCase("textbook epidermis, 0.25 mm", "where the method was published",
             ((0.3, 25.0, 0.8, 1.4, 0.25), (0.05, 12.5, 0.8, 1.4, INF))),
    HardCase("skin in diffuse light", "in the domain of the skin table",
             ((1.0, 30.0, 0.8, 1.4, 0.1), (0.15, 15.0, 0.8, 1.4, INF)), "diffuse"),
    HardCase("opaque epidermis", "albedo below 0.5: nothing diffuses",
             ((40.0, 40.0, 0.8, 1.4, 0.1), (0.5, 20.0, 0.8, 1.4, INF))),
    HardCase("pigment film of a micrometre", "melanin of half the volume",
             ((60.0, 45.0, 0.8, 1.4, 0.001), (0.5, 22.0, 0.8, 1.4, INF))),
    HardCase("a layer of 1 nm", "a thousandth of a wavelength, optically nothing",
             ((1.0, 30.0, 0.8, 1.4, NANOMETRE), DERMIS)),
    HardCase("no epidermis at all to compare", "the same without that layer", (DERMIS,)),
    HardCase("no absorption, half-space", "all light comes back after any number of scatterings",
             ((0.0, 10.0, 0.0, 1.4, INF),), photons=400),
    HardCase("no absorption, thick slab", "R + T = 1 over a thousand mean free paths",
             ((0.0, 1000.0, 0.0, 1.4, 1.0),), photons=200),
    HardCase("no absorption, thin slab", "images of the source sum conditionally", ((0.0, 1.0, 0.0, 1.4, 0.1),)),
    HardCase("albedo 1 - 1e-9, half-space", "the last digits decide", ((1e-8, 10.0, 0.0, 1.0, INF),), photons=400),
    HardCase("clear slab", "Fresnel alone, no medium", ((0.0, 0.0, 0.0, 1.5, 1.0),)),
    HardCase("absorber without scattering", "Beer and Lambert alone", ((0.7, 0.0, 0.0, 1.5, 1.0),)),
    HardCase("absorbing half-space", "nothing comes back", ((0.7, 0.0, 0.5, 1.4, INF),)),
    HardCase("denormal coefficients", "5e-324 per mm", ((5e-324, 5e-324, 0.8, 1.4, 1.0),)),
    HardCase("one scattering in a kilometre", "mu_s' of 1e-6 in a slab", ((0.0, 1e-6, 0.0, 1.4, 1.0),)),
    HardCase("forward peak, g = 0.999", "the phase function is a needle", ((0.1, 1000.0, 0.999, 1.4, 1.0),), photons=2000),
    HardCase("backward peak, g = -0.99", "every scattering turns the light round", ((0.1, 50.0, -0.99, 1.4, 1.0),)),
    HardCase("index 3", "two thirds of the light inside is totally reflected", ((0.05, 10.0, 0.8, 3.0, INF),), photons=2000),
    HardCase("trapped light", "index 3, almost clear: what scatters into the guide hardly leaves it",
             ((1e-6, 0.01, 0.0, 3.0, 0.1),)),
    HardCase("index of 1 + 2^-52", "a face that is none", ((0.2, 20.0, 0.8, 1 + 2**-52, 1.0),)),
    HardCase("glass on skin", "a halo of total reflection", ((0.0, 0.0, 0.0, 1.5, 1.0), DERMIS)),
    HardCase("air gap in skin", "index 1 between two of 1.4",
             ((0.5, 30.0, 0.8, 1.4, 0.1), (0.0, 0.0, 0.0, 1.0, 0.01), DERMIS)),
    HardCase("absorber on skin", "a filter that does not scatter", ((2.0, 0.0, 0.0, 1.4, 0.2), DERMIS)),
    HardCase("a metre of milk", "finite, but without a bottom for any light", ((1e-3, 100.0, 0.9, 1.35, METRE),), photons=1000),
    HardCase("1e6 per mm over a metre", "1e9 mean free paths", ((1e6, 1e6, 0.9, 1.4, METRE),)),
    HardCase("a metre at 1e6 per mm, no absorption", "1e9 mean free paths without any loss",
             ((0.0, 1e6, 0.0, 1.0, METRE),), photons=50),
    HardCase("eight unlike layers", "clear, absorbing, scattering, dense and thin by turns",
             ((0.0, 0.0, 0.0, 1.5, 0.2), (0.5, 20.0, 0.8, 1.4, 0.05), (3.0, 0.0, 0.0, 1.33, 0.01),
              (0.02, 80.0, 0.95, 1.6, 0.1), (0.0, 5.0, -0.5, 1.0, 0.3), (0.1, 10.0, 0.0, 2.5, 0.02),
              (1e-4, 1.0, 0.3, 1.2, 1.0), (0.05, 12.0, 0.8, 1.4, 2.0))),
)  # fmt: skip

REFUSED = (
    ("mu_a is NaN", ((math.nan, 1.0, 0.0, 1.4, 1.0),)),
    ("thickness below 0", ((1.0, 1.0, 0.0, 1.4, -1.0),)),
    ("g = 1", ((1.0, 1.0, 1.0, 1.4, 1.0),)),
)
