// What is in the skin that a picture shows: melanin, hemoglobin and oxygenation of every texel of a colour map.
//
// Three chromophores against three colours, so each colour inside the skin gamut has one answer, and priors decide where
// the colour says little (blood under dark skin, oxygenation everywhere). The answers stand in a table over L*a*b*; a
// texel is an interpolation in it, a local Wiener shrinkage against the noise of the picture, and an interpolation in
// the forward table, which says what the estimate looks like.
//
// Pictures come in rows, so that none has to be in memory whole: PictureOverview sees all rows once and keeps a small
// picture, picture_model() finds noise, shading and what is skin in it, and invert_rows() estimates any rows, given a
// few more above and below. The result does not depend on how the rows are cut or on the number of threads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "sanguine/colour.hpp"
#include "sanguine/parallel.hpp"
#include "sanguine/parameters.hpp"

namespace sanguine {

/// Where a texel's estimate lies: ln melanin, ln hemoglobin, oxygenation.
using SkinPoint = std::array<float, 3>;

/// One axis of SkinPoint: its range, and the normal prior on it.
struct InversionAxis {
    std::string_view id;      ///< of the schema
    double lower, upper;      ///< on the axis: ln of a fraction, or a fraction
    double mean, sd;          ///< of the prior, on the axis
    std::string_view source;  ///< of the prior
};
const std::array<InversionAxis, 3>& inversion_axes();

/// How far the colour of an estimate may lie from the picture without a pull of the priors: standard deviation of each of
/// L*, a*, b*, of what the model of skin does not follow. Measured faces leave Delta E 0.76 (docs/measured_skin.md), about
/// 1 in L*a*b*.
inline constexpr double inversion_model_sd = 0.6;

/// Rows and columns around a texel that its estimate looks at.
inline constexpr int inversion_halo = 3;

/// Nodes per axis of the table over L*a*b*; docs/inversion.md has error and time by size.
inline constexpr int default_inversion_nodes = 33;

/// The answers for one skin, of which all but melanin, hemoglobin and oxygenation is given. Immutable.
///
/// Colours are those of `sanguine skin`: what the oil film reflects is taken off the skin's reflectance.
class SkinInverse {
public:
    /// Throws std::invalid_argument for fewer than 5 or more than 129 nodes.
    SkinInverse(const SkinParameters& skin, const Matrix3& rgb_from_xyz, int nodes, int threads, const Progress& progress);

    const SkinParameters& skin() const { return skin_; }
    int nodes() const { return nodes_; }
    /// L*a*b* of the table's first and last nodes.
    std::array<std::array<float, 3>, 2> lab_range() const;
    std::size_t bytes() const { return (forward_.size() + inverse_.size()) * sizeof(float); }

    /// L*a*b* of a skin, as the forward table has it.
    std::array<float, 3> lab(const SkinPoint& point) const;

    /// The estimate for a colour, as the table has it.
    SkinPoint point(const std::array<float, 3>& lab) const;

    /// Linear RGB, as the pictures have it, to L*a*b* and back. Negative RGB counts as 0.
    std::array<float, 3> lab_of_rgb(const std::array<float, 3>& rgb) const;
    std::array<float, 3> rgb_of_lab(const std::array<float, 3>& lab) const;

private:
    friend struct InversionKernel;

    SkinParameters skin_;
    int nodes_;
    std::array<std::array<float, 3>, 3> xyz_from_rgb_, rgb_from_xyz_;  ///< XYZ per white
    std::array<float, 3> lab_begin_, lab_scale_;                       ///< node = (lab - begin) * scale
    std::vector<float> forward_;  ///< [oxygenation][hemoglobin][melanin][4]: CIE f of X, Y, Z per white, 0
    std::vector<float> inverse_;  ///< [b][a][L][4]: the SkinPoint, 0
};

/// Rows of a picture: interleaved, `channels` 3 or 4, the fourth is alpha. A texel that is not finite or whose alpha is
/// 0 is not there.
struct PictureRows {
    const float* pixels;
    int width, first, count, channels;
    bool srgb;  ///< encoded as IEC 61966-2-1; false: linear
};

/// A small picture of a large one, and samples of its noise. Rows are added once each, in any order.
class PictureOverview {
public:
    PictureOverview(int width, int height);

    /// Throws std::invalid_argument for rows that the picture does not have or that were added before.
    void add(const PictureRows& rows, int threads);

    int width() const { return width_; }
    int height() const { return height_; }

private:
    friend struct InversionKernel;

    int width_, height_;
    std::vector<char> added_;                  ///< rows
    bool srgb_ = false;                        ///< of the rows
    int cell_, columns_, rows_;                ///< texels per side of a cell; cells
    std::vector<std::int64_t> sums_;           ///< [cell][4]: linear RGB times alpha, alpha; fixed point
    int step_x_, step_y_, sample_columns_, sample_rows_;
    std::vector<float> samples_;               ///< [sample row][7 rows][sample column][7 columns][3]: cube root of RGB
};

enum class Shading { off, automatic, on };

struct InversionOptions {
    Shading shading = Shading::automatic;
    double noise = -1;    ///< standard deviation in L*a*b*; negative: estimated from the picture
    double quantum = 0;   ///< step between two values of the file, as 1/255
};

/// What holds for a whole picture.
struct PictureModel {
    int width, height;
    std::array<std::array<float, 3>, 3> noise;  ///< lower Cholesky factor of its covariance in L*a*b*
    double noise_sd;                            ///< mean over L*, a*, b*; 0: too little to be filtered
    SkinPoint centre, spread;                   ///< median and robust standard deviation of the skin's estimates
    double skin_share;                          ///< of the overview
    double shading_found, shading_pigment;      ///< standard deviation of ln shading: found, and what pigment may feign
    double shading_kept;                        ///< share of what was found that is kept
    double exposure;                            ///< ln of a factor on the whole picture that is in the shading
    int columns, rows, cell;                    ///< of the overview
    std::vector<float> shading;                 ///< [row][column] factor on the light; empty: 1 everywhere
    std::vector<float> near;                    ///< [row][column][2] ln melanin of the skin around, and of all in a small patch
    std::vector<float> fill;                    ///< [row][column][3] SkinPoint for what is not skin
};

/// The models of pictures that belong together, such as the tiles of one UDIM set: what is skin, its noise and the mean
/// of the shading are found over all of them.
std::vector<PictureModel> picture_models(const SkinInverse& inverse, std::span<const PictureOverview* const> overviews,
                                         const InversionOptions& options, int threads);

/// Counts over texels: what medians and ranges are read from, without keeping the texels.
struct InversionCounts {
    static constexpr int bins = 2048;
    static constexpr double error_step = 0.02;      ///< bins of Delta E; the last one holds all above
    // Over skin, which is where the mask is above 1/2:
    std::array<std::uint64_t, bins> error{};
    std::array<std::array<std::uint64_t, bins>, 3> point{};  ///< per axis from lower to upper
    std::uint64_t texels = 0, there = 0, skin = 0;

    void operator+=(const InversionCounts& other);
    /// Value below which `share` of the skin lies.
    double error_at(double share) const;
    double point_at(int axis, double share) const;
};

/// Where estimates of rows go, each as [row][column][channels], from the first row that is asked for; null: not wanted.
struct InversionOutput {
    float* skin = nullptr;      ///< 4: hemoglobin, melanin, oil (the skin's own), oxygenation
    float* residual = nullptr;  ///< 3: picture / (estimate as it looks * shading); 1 where the picture is not there
    float* shading = nullptr;   ///< 1: factor on the light
    float* mask = nullptr;      ///< 1: probability of skin, 0 to 1
    float* error = nullptr;     ///< 1: CIEDE2000 between picture / shading and the estimate; 0 where nothing is there
    bool shaded_residual = false;  ///< the shading is in the residual
};

/// Estimates of the rows `first` to `first + count`. `rows` must hold them and inversion_halo more on either side, where
/// the picture has them. Throws std::invalid_argument if it does not.
InversionCounts invert_rows(const SkinInverse& inverse, const PictureModel& model, const PictureRows& rows, int first,
                            int count, const InversionOutput& out, int threads, const Progress& progress);

/// CIEDE2000 of arrays [3][count], as invert_rows() computes it: within 0.002 of delta_e_2000().
void delta_e_2000_fast(std::size_t count, const float* lab_1, const float* lab_2, float* out);

}  // namespace sanguine
