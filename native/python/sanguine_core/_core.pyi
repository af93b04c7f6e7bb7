"""
Sanguine's native core. Units stand in the names: mm, per_mm, nm; fractions are 0 to 1.
"""

from collections.abc import Callable, Mapping, Sequence
import os
from typing import Annotated

import numpy
from numpy.typing import NDArray


def fit_parameters() -> list:
    """
    What a fit may move, as dicts: id, scale (on which prior and error are normal), lower, upper, prior_mean and
    held_at (in the unit of the parameter; None where it is fitted), prior_sd and freed_sd (on the scale, as it is
    and when freed on purpose), source.
    """

def fit(spectra: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], wavelengths_nm: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], specular_included: bool = True, prior: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)] | None = None, threads: int = 0, progress: Callable | None = None) -> dict:
    """
    Skins whose reflectance is nearest to measured spectra (N, W), 0 to 1, under the priors.

    wavelengths_nm: (W,) increasing within 380 to 780. specular_included: the spectra hold the surface's
    reflection. prior: (F, 2) mean and standard deviation per row of fit_parameters(); 0 holds a value.
    Returns a dict: value, standard_error, informed (share of the prior's variance that the data removed),
    at_bound (1 or 0), all (N, F); correlation (N, F, F); reflectance (N, W), the fitted one; rmse, noise (per
    expected noise), iterations, converged (1 or 0), all (N,).
    progress(done, total) is called on this thread a few times a second; False raises Cancelled.
    """

INVERSION_HALO: int = 3

INVERSION_NODES: int = 33

def inversion_axes() -> list:
    """
    The axes of a skin point, ln melanin, ln hemoglobin and oxygenation, as dicts: id, lower and upper, mean and sd
    of the prior, all on the axis; source.
    """

class SkinInverse:
    """
    Tables from colour to skin point for one skin, of which all but melanin, hemoglobin and
    oxygenation is given. Immutable; a few megabytes.
    """

    def __init__(self, skin: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], working_space: str | Annotated[NDArray[numpy.float64], dict(shape=(3, 3), order='C', device='cpu', writable=False)] = 'rec709', nodes: int = 33, threads: int = 0, progress: Callable | None = None) -> None:
        """
        skin: (P,) in the order of parameters(). working_space: of the pictures, as in linear_rgb(). nodes: per axis of
        L*a*b*, 5 to 129. progress(done, total) is called a few times a second; False raises Cancelled.
        """

    @property
    def nodes(self) -> int: ...

    @property
    def lab_range(self) -> list[list[float]]:
        """L*a*b* of the first and of the last nodes."""

    @property
    def bytes(self) -> int:
        """Size of the tables."""

    def lab(self, points: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None))]:
        """L*a*b* (N, 3) of skin points (N, 3), as the forward table has it."""

    def point(self, lab: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None))]:
        """Skin points (N, 3) of L*a*b* (N, 3), as the inverse table has it."""

    def lab_of_rgb(self, rgb: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None))]:
        """L*a*b* (N, 3) of linear RGB (N, 3) of the working space."""

    def rgb_of_lab(self, lab: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None))]:
        """Linear RGB (N, 3) of the working space of L*a*b* (N, 3)."""

class PictureOverview:
    """A small picture of a large one, and samples of its noise."""

    def __init__(self, width: int, height: int) -> None: ...

    def add(self, rows: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], first: int = 0, srgb: bool = False, threads: int = 0) -> None:
        """
        Rows (N, width, 3 or 4) float32 from row `first` on, each row once, in any order; the fourth channel is alpha.
        srgb: encoded as sRGB, else linear. How the rows are cut does not matter.
        """

class PictureModel:
    """Noise, shading and what is skin in a picture."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def noise_sd(self) -> float:
        """Standard deviation of the noise, mean over L*, a*, b*."""

    @property
    def centre(self) -> list[float]:
        """Median skin point of the skin."""

    @property
    def spread(self) -> list[float]:
        """Robust standard deviation of the skin's points."""

    @property
    def skin_share(self) -> float: ...

    @property
    def shading_found(self) -> float:
        """Standard deviation of ln shading, before what is kept of it."""

    @property
    def shading_pigment(self) -> float:
        """The same as oxygenation alone could feign it."""

    @property
    def exposure(self) -> float:
        """ln of a factor on the whole picture that is in the shading."""

    @property
    def shading_kept(self) -> float:
        """Share of the found shading that is kept, 0 to 1."""

def picture_models(inverse: SkinInverse, overviews: Sequence[PictureOverview], shading: str = 'auto', noise: float | None = None, quantum: float = 0.0, threads: int = 0) -> list[PictureModel]:
    """
    Models of pictures that belong together, as the tiles of a UDIM set do.

    shading: 'off', 'auto' (as far as it is more than pigment explains) or 'on'. noise: standard deviation in L*a*b*;
    None estimates it. quantum: step between two values of the file, 1/255 for 8 bits, 0 for floats.
    """

class InversionCounts:
    """Counts over texels, to be added up over bands and tiles."""

    def __init__(self) -> None: ...

    def __iadd__(self, arg: InversionCounts, /) -> InversionCounts: ...

    @property
    def texels(self) -> int: ...

    @property
    def there(self) -> int:
        """Texels that are finite and whose alpha is above 0."""

    @property
    def skin(self) -> int:
        """Texels with a mask above 1/2."""

    def error_at(self, share: float) -> float:
        """Delta E 2000 below which this share of the skin lies."""

    def point_at(self, axis: int, share: float) -> float:
        """
        Value of an axis of inversion_axes() below which this share of the skin lies.
        """

def invert_rows(inverse: SkinInverse, model: PictureModel, rows: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], rows_first: int, first: int, count: int, srgb: bool = False, shaded_residual: bool = False, wanted: Sequence[str] = ['skin_map', 'residual', 'mask', 'error'], threads: int = 0, progress: Callable | None = None) -> dict:
    """
    Chromophores of the rows `first` to `first + count` of a picture.

    Parameters
    ----------
    rows : (N, width, 3 or 4) float32, from row `rows_first` on: the wanted ones and INVERSION_HALO more on either side,
        where the picture has them
    srgb : encoded as sRGB, else linear
    shaded_residual : the shading is in the residual
    wanted : any of skin_map, residual, mask, error, shading

    Returns
    -------
    dict of float32 arrays, and "counts" (InversionCounts): skin_map (count, width, 4): hemoglobin, melanin, oil, oxygenation;
    residual (count, width, 3): picture / (look of the estimate x shading); mask: probability of skin; error: CIEDE2000 between
    picture / shading and the look of the estimate; shading: factor on the light. How the rows are cut and the number of threads
    change nothing.
    """

def delta_e_2000_fast(lab_1: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], lab_2: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float32], dict(shape=(None,))]:
    """CIEDE2000 (N,) in single precision, as invert_rows() computes it."""

class Cancelled(Exception):
    pass

SKIN_INDEX: float = 1.4

OIL_FILM_INDEX: float = 1.5

def parameters() -> list:
    """
    Rows of the schema as dicts; their order is the column order of every (N, P) array.
    """

def derived_parameters() -> list:
    """Views of stored parameters, which can be set in their place."""

def optical_coefficients(skins: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], wavelengths_nm: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> dict:
    """
    Absorption and reduced scattering of both layers [1/mm].

    skins: (N, P), columns in the order of parameters(); wavelengths_nm: (W,) within 380 to 780.
    Returns a dict of (N, W) arrays. Source: Donner and Jensen 2006.
    """

def reflectance(skins: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], wavelengths_nm: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], threads: int = 0, progress: Callable | None = None) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]:
    """
    Diffuse reflectance (N, W) of bare skin per unit of Lambertian light that falls on it.

    The reflection of the surface is not in it, see surface(). `oil` plays no part.
    progress(done, total) is called on this thread a few times a second; False raises Cancelled.
    """

def surface(skins: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]:
    """
    Share of Lambertian light that the surface reflects, (N, 2): oil film alone, film and skin together.

    Under the film the skin's reflectance is (1 - film) * reflectance().
    """

def default_radii_mm() -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]:
    """
    Logarithmic radii from 0.0003 to 40 mm for radial_profile().

    The disk inside the first one holds 2 pi r^2 R(r): there every profile falls as 1/r.
    """

def radial_profile(skins: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], wavelengths_nm: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], radius_mm: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], threads: int = 0, progress: Callable | None = None) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None, None))]:
    """
    R(r) [1/mm^2], (N, W, R), for Lambertian light on one point; its plane integral is reflectance().
    """

def xyz(spectra: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], wavelengths_nm: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], illuminant: str = 'D65') -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]:
    """
    XYZ (N, 3) of reflectance spectra (N, W): CIE 1931 2 degrees, illuminant 'D65' or 'A', Y = 100 for white.
    """

def lab(xyz: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], illuminant: str = 'D65') -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]:
    """CIE L*a*b* (N, 3) of XYZ (Y = 100 for white) under 'D65' or 'A'."""

def delta_e_2000(lab_1: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], lab_2: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]:
    """CIEDE2000 differences (N,) of two (N, 3) of L*a*b*."""

def linear_rgb(xyz: Annotated[NDArray[numpy.float64], dict(shape=(None, 3), order='C', device='cpu', writable=False)], working_space: str | Annotated[NDArray[numpy.float64], dict(shape=(3, 3), order='C', device='cpu', writable=False)] = 'rec709') -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]:
    """
    Linear RGB (N, 3), signed, of XYZ (Y = 100 for white); perfect white is (1, 1, 1).

    working_space: 'rec709', 'rec2020', 'acescg', or a (3, 3) matrix from XYZ (D65, Y = 1) to RGB.
    """

def burley_lobes(skins: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], working_space: str | Annotated[NDArray[numpy.float64], dict(shape=(3, 3), order='C', device='cpu', writable=False)] = 'rec709', lobe_count: int = 4, threads: int = 0, progress: Callable | None = None) -> dict:
    """
    Profiles in RGB as non-negative lobes (exp(-r/d) + exp(-r/(3d))) / (8 pi d r), widest first.

    Returns a dict: weights (N, K, 3), adding up to rgb where that is positive; d_mm (N, K, 3);
    clamped (N, 3), share of the profile that is negative; fit_error (N, 3), L1 error over the plane per
    reflectance; rgb (N, 3), the reflectance. Cycles' radius is 4 pi d.
    """

class SolverError(Exception):
    pass

def solvers() -> list:
    """
    The solvers of solve(), cheapest first, as dicts of id and summary; 'auto' chooses among them.
    """

def solve(layers: Annotated[NDArray[numpy.float64], dict(shape=(None, 5), order='C', device='cpu', writable=False)], incidence: str = 'normal', radii_mm: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, solver: str = 'auto', tolerance: float = 0.01, max_seconds: float = 60.0, max_photons: int = 1073741824, seed: int = 1, threads: int = 0, progress: Callable | None = None) -> dict:
    """
    What becomes of light that falls from air on a stack of layers; shares of the incident light.

    layers: (L, 5) from the surface down, mu_a and mu_s [1/mm], Henyey-Greenstein g, index n, thickness [mm],
    infinite in the last layer for a half-space. incidence: 'normal' (pencil beam) or 'diffuse' (Lambertian
    light on one point). radii_mm: (R,) ascending, where the profiles are wanted; without them totals alone.
    Returns a dict: Rd (left the top after scattering), R_unscattered (back from a deeper face without), Tt (all
    that left the bottom), specular (first surface), R_per_mm2 and T_per_mm2 (scattered light, (R,) or None),
    error_estimate (relative; of profiles half of the L1 norm), solver, because, warnings, elapsed_ms.
    Raises ValueError for what cannot be, SolverError where the solver has no answer. progress(done, total) is
    called on this thread a few times a second; False raises Cancelled.
    """

def adding_doubling(layers: Annotated[NDArray[numpy.float64], dict(shape=(None, 5), order='C', device='cpu', writable=False)], incidence: str, streams: int) -> dict:
    """
    Totals of a stack (as in solve()) with a given number of directions per hemisphere, as a dict.
    """

def multipole(layers: Annotated[NDArray[numpy.float64], dict(shape=(None, 5), order='C', device='cpu', writable=False)], radii_mm: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, terms: int = -1) -> dict:
    """
    The classical multipole as it comes, without checks: a dict of R, T and R_per_mm2 per unit of light that
    enters the stack. May be negative. terms: N for the dipoles -N to N of a layer, -1 for their closed sum.
    """

def surface_strain(position: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], displacements: Annotated[NDArray[numpy.float32], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)], measure: str = 'log') -> Annotated[NDArray[numpy.float32], dict(shape=(None, None, None))]:
    """
    Strain of a surface whose vertices move, one result per row of displacements.

    Parameters
    ----------
    position : (V, 3) float32, at rest
    triangles : (T, 3) int32, indices of vertices
    displacements : (K, V, 3) float32, in the same unit
    measure : "log" (Hencky, exact; trace = logarithm of the ratio of areas) or "linear" (infinitesimal; sums of
        displacements give sums of strains)

    Returns
    -------
    (K, V, 6) float32: xx, yy, zz, xy, xz, yz of a symmetric tensor in the tangent plane at rest. Always finite: stretches
    count as 0.05 at least and 20 at most, and triangles without area take no part.
    """

def vertex_areas(position: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float32], dict(shape=(None,))]:
    """
    Area that each vertex stands for, (V,) float32: a third of its triangles'.
    """

def stripe_phase(position: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], across: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], weight: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float32], dict(shape=(None,))]:
    """
    Phase in cycles, (V,) float32, whose gradient follows `across` as nearly as one function can.

    Parameters
    ----------
    position : (V, 3) float32
    triangles : (T, 3) int32, indices of vertices
    across : (V, 3) float32, direction across the stripes times cycles per unit length; its sign carries no meaning
    weight : (V,) float32, 0 or more: how much each direction counts
    """

class ImageError(OSError):
    pass

def rasterize_uv(uv: Annotated[NDArray[numpy.float32], dict(shape=(None, 2), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], values: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], width: int, height: int, padding_px: int, fill: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], threads: int = 0) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None, None))]:
    """
    Draw per-corner values into the UV layout of a mesh.

    Parameters
    ----------
    uv : (L, 2) float32, one per corner (loop); (0, 0) to (1, 1) is the image
    triangles : (T, 3) int32, indices of corners
    values : (L, C) float32
    width, height : pixels, 1 to 16384
    padding_px : how far values reach beyond the mesh, over seams and borders
    fill : (C,) float32, for all other pixels
    threads : 0 uses every core; the result does not depend on it

    Returns
    -------
    (height, width, C) float32; row 0 is the bottom row (V = 0), as in Blender's images.

    Notes
    -----
    Triangles without area are skipped (`count_degenerate_uv` counts them), those outside the unit square clipped.
    """

def count_degenerate_uv(uv: Annotated[NDArray[numpy.float32], dict(shape=(None, 2), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)]) -> int:
    """
    How many triangles have no area in UV space, or a coordinate that is not finite.
    """

def uv_coverage(uv: Annotated[NDArray[numpy.float32], dict(shape=(None, 2), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], width: int, height: int) -> dict:
    """
    How a UV layout fills the unit square, counted on the texels of a map of width x height.

    Returns a dict: covered (texels whose centre lies in a triangle), overlapping (in more than one; common edges do not
    count), outside (triangles with area and no point in the unit square).
    """

def read_image(path: str | os.PathLike) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None, None))]:
    """
    Read a picture as (H, W, C) float32, row 0 at the bottom, values as stored (8 bits divided by 255).

    Raises ImageError (an OSError) that names the file.
    """

def write_image(path: str | os.PathLike, pixels: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], pixel_type: str | None = None) -> None:
    """
    Write (H, W, C) float32, row 0 at the bottom, as EXR, TIFF, PNG or JPEG (by the file name's extension).

    `pixel_type` is "uint8", "uint16", "half" or "float"; None takes half for EXR, float for TIFF and uint8 for others.
    Values are not colour managed. The file appears whole or not at all. Raises ImageError (an OSError).
    """

def write_exr_map(path: str | os.PathLike, pixels: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], channels: Sequence[str], attributes: Mapping[str, str], half: bool = True) -> None:
    """
    Write a chromophore map: scanline EXR with one named channel per column of `pixels`.

    Parameters
    ----------
    path : the file appears whole or not at all
    pixels : (H, W, C) float32, row 0 at the bottom, finite
    channels : C different names
    attributes : strings for the header (units, schema version)
    half : 16-bit floats; False keeps 32 bits

    Raises ImageError (an OSError), or ValueError for names or values that do not fit.
    """

def read_exr_map(path: str | os.PathLike) -> tuple[Annotated[NDArray[numpy.float32], dict(shape=(None, None, None))], list[str], dict[str, str]]:
    """
    Read a chromophore map: (pixels, channel names, string attributes).

    Channels come in the file's order, which is alphabetical in every EXR. Raises ImageError (an OSError).
    """

def read_exr_map_info(path: str | os.PathLike) -> tuple[int, int, list[str], dict[str, str]]:
    """
    The header of a chromophore map: (width, height, channel names, string attributes).
    """

class RowReader:
    """
    A picture of any format, some rows at a time; a context manager.

    read_rows(first, count) gives (count, W, C) float32, row 0 of the picture at the bottom, values as stored. Any rows in
    any order; from the top down is cheapest, since files are decoded from there, and rows of the answer before are not
    read again (a halo costs nothing). Memory is that of the rows, rounded up to tiles, and what the format's decoder
    needs: interlaced PNG, progressive JPEG, GIF and WebP are whole pictures there. Raises ImageError.
    """

    def __init__(self, path: str | os.PathLike) -> None: ...

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def channels(self) -> list[str]:
        """Names, in the file's order."""

    @property
    def pixel_type(self) -> str:
        """uint8, uint16, half, float or another of OpenImageIO's names."""

    @property
    def alpha_channel(self) -> int | None:
        """Index of the channel that is alpha, or None."""

    def read_rows(self, first: int, count: int) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None, None))]: ...

    def close(self) -> None: ...

    def __enter__(self) -> object: ...

    def __exit__(self, *args) -> None: ...

class MapWriter:
    """
    A chromophore map written some rows at a time; a context manager.

    The end of the `with` block commits, an exception in it abandons: the file appears whole or not at all.
    channels, attributes, half: as in write_exr_map. from_top: bands come from the top of the picture down, else from the
    bottom up; either way row 0 of each band is its lowest. Raises ImageError; ValueError for what does not fit.
    """

    def __init__(self, path: str | os.PathLike, width: int, height: int, channels: Sequence[str], attributes: Mapping[str, str], half: bool = True, from_top: bool = False) -> None: ...

    @property
    def rows_left(self) -> int: ...

    def write_rows(self, rows: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)]) -> None:
        """The next rows: (N, W, C) float32, finite."""

    def commit(self) -> None:
        """Makes the file appear; rows must not be missing."""

    def abandon(self) -> None:
        """Leaves nothing behind."""

    def __enter__(self) -> object: ...

    def __exit__(self, type: object | None, value: object | None, traceback: object | None) -> None: ...

def make_tx(source: str | os.PathLike, destination: str | os.PathLike) -> None:
    """
    Write `source` as a tiled, mip-mapped .tx texture; values are data, not colour managed.

    EXR inside for a source in EXR, else TIFF. The file appears whole or not at all. Raises ImageError (an OSError).
    """

def texture_info(path: str | os.PathLike) -> dict:
    """
    Of a picture, a dict: tile_width, tile_height (0 without tiles), levels, mean (from the level of one pixel).
    """

def contact_sheet(paths: Sequence[str | os.PathLike], captions: Sequence[str], out_path: str | os.PathLike, columns: int = 5, gap_px: int = 8, background: float = 0.10000000149011612) -> None:
    """
    Set pictures side by side with a caption below each (none if `captions` is empty).

    8-bit values are copied unchanged. `background` is 0 to 1 in the pictures' encoding. Raises ImageError.
    """

class TexelMap:
    """
    The texels of a UV layout that show skin, N of them.

    Arrays are views of the map, read-only.
    """

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def texel(self) -> Annotated[NDArray[numpy.uint32], dict(shape=(None,), writable=False)]:
        """
        (N,) uint32: row * width + column, row 0 being the bottom row (V = 0); ascending.
        """

    @property
    def place_mm(self) -> Annotated[NDArray[numpy.float32], dict(shape=(None, 3), writable=False)]:
        """(N, 3) float32."""

    @property
    def size_mm(self) -> Annotated[NDArray[numpy.float32], dict(shape=(None,), writable=False)]:
        """(N,) float32: side of the square of skin that a texel shows."""

    @property
    def triangle(self) -> Annotated[NDArray[numpy.uint32], dict(shape=(None,), writable=False)]:
        """(N,) uint32: the triangle that a texel shows."""

    @property
    def barycentric(self) -> Annotated[NDArray[numpy.float32], dict(shape=(None, 3), writable=False)]:
        """(N, 3) float32: where in the triangle, by its corners."""

class SkinSurface:
    """
    The skin of a face as features grow on it; immutable.

    Parameters
    ----------
    position_mm : (V, 3) float32, the neutral face; Z up, it looks along -Y
    uv : (L, 2) float32, one per corner (loop)
    triangles : (T, 3) int32, indices of corners
    corner_vertex : (L,) int32, the vertex of each corner
    region_names : R ids of rigs/regions.toml
    region_weights : (V, R) float32, 0 to 1

    Notes
    -----
    Vertices at the same place count as one. Raises ValueError for indices that do not exist, values that are not finite,
    weights outside 0 to 1 and a mesh without area.
    """

    def __init__(self, position_mm: Annotated[NDArray[numpy.float32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], uv: Annotated[NDArray[numpy.float32], dict(shape=(None, 2), order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(shape=(None, 3), order='C', device='cpu', writable=False)], corner_vertex: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], region_names: Sequence[str], region_weights: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def area_mm2(self) -> float: ...

    def texels(self, width: int, height: int, padding_px: int, threads: int = 0) -> TexelMap:
        """
        The texels that show skin or lie within `padding_px` of it (with the nearest place of the skin).

        `width` and `height` are allowed from 1 to 16384; `threads` = 0 uses every core and changes nothing in the result.
        """

class SeamTexels:
    """
    The texels that look-ups on UV seams read, N of them.

    Parameters
    ----------
    surface : SkinSurface
    width, height : texels of an image, 1 to 16384
    tiles : lower left corners in UV of the images that there are

    Notes
    -----
    A bilinear look-up at a side that two triangles share reads other texels on each of its two places in UV. `equalize`
    changes these texels, as little as that takes, until both read alike. Beyond the border of an image a look-up reads the
    border. Liu et al. 2017, "Seamless: Seam Erasure and Seam-Aware Decoupling of Shape from Mesh Resolution".
    """

    def __init__(self, surface: SkinSurface, width: int, height: int, tiles: Sequence[tuple[int, int]] = ((0, 0))) -> None: ...

    @property
    def tile(self) -> Annotated[NDArray[numpy.uint32], dict(shape=(None,), writable=False)]:
        """(N,) uint32: index of the image in `tiles`; ascending."""

    @property
    def texel(self) -> Annotated[NDArray[numpy.uint32], dict(shape=(None,), writable=False)]:
        """
        (N,) uint32: row * width + column, row 0 being the bottom row (V = 0); ascending in each image.
        """

    def equalize(self, values: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], threads: int = 0) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None))]:
        """
        Values (N, C) float32 that read alike on both sides of every seam, from those of the maps as they are.

        Returns (N, C) float32. Each channel stays in the range that it has in `values`; `threads` = 0 uses every core and
        changes nothing in the result. Raises ValueError for another shape and for values that are not finite.
        """

def features() -> list:
    """
    Every feature that grows on a face: dicts with id, label, help, source and changes.

    `changes` are the columns of its layer, dicts with channel (log_hemoglobin, log_melanin, log_oil: natural logarithms
    of a factor; oxygenation, ink_per_mm, height_mm: sums), low and high: the range that the layer stays in.
    """

def grow(feature_id: str, surface: SkinSurface, texels: TexelMap, seed: int, age_years: float, sun: float, masculinity: float, threads: int = 0, progress: Callable | None = None) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None))]:
    """
    Grow one feature and paint it on the texels.

    Parameters
    ----------
    feature_id : an id of features()
    surface : SkinSurface, the one that `texels` is of
    texels : TexelMap
    seed : 0 to 2^64 - 1; with equal arguments the result has the same bytes
    age_years : 0 to 120
    sun : exposure, 0 none to 1 a life outdoors
    masculinity : 0 female to 1 male
    threads : 0 uses every core; the result does not depend on it
    progress : called with (done, total) on this thread a few times a second; False raises Cancelled

    Returns
    -------
    (N, C) float32: a row for each texel of `texels.texel`, a column for each of the feature's changes.
    """

def counters() -> dict:
    """Work done since the last reset_counters()."""

def reset_counters() -> None: ...
