#include "sanguine/texture_file.hpp"

#include <sstream>
#include <string_view>

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/strutil.h>

#include "atomic_file.hpp"
#include "open_image.hpp"

namespace sanguine {

void make_tx(const std::filesystem::path& source, const std::filesystem::path& destination) {
    if (OIIO::Strutil::lower(destination.extension().string()) != ".tx")
        throw ImageError(destination, "cannot be written: the extension .tx is allowed");
    const auto input = open_checked(source);
    OIIO::ImageSpec layout = input->spec();
    check_fits_memory(source, layout);
    layout.channelformats.clear();  // in memory all channels have one type
    OIIO::ImageBuf pixels(layout);
    check_read(input->read_image(0, 0, 0, layout.nchannels, layout.format, pixels.localpixels()), *input, source);

    OIIO::ImageSpec write_as;
    if (std::string_view(input->format_name()) == "openexr") write_as.attribute("maketx:fileformatname", "openexr");
    write_as.attribute("oiio:UnassociatedAlpha", 1);
    write_as.attribute("wrapmodes", "clamp,clamp");  // black beyond a border would be skin without blood
    write_as.attribute("maketx:set_full_to_pixels", 1);
    AtomicFile file(destination);
    std::ostringstream ignored;  // else it writes to the console
    if (!OIIO::ImageBufAlgo::make_texture(OIIO::ImageBufAlgo::MakeTxTexture, pixels, file.temporary().string(),
                                          write_as, &ignored))
        throw ImageError(destination, "cannot be written: " + OIIO::geterror());
    file.commit();
}

TextureInfo texture_info(const std::filesystem::path& path) {
    const auto input = open_checked(path);
    TextureInfo info{input->spec().tile_width, input->spec().tile_height, 1, {}};
    // A picture of 2^14 has 15 levels; what claims more is broken.
    while (info.levels < 15 && input->seek_subimage(0, info.levels)) ++info.levels;
    const OIIO::ImageSpec last = input->spec(0, info.levels - 1);
    if (last.width != 1 || last.height != 1 || last.nchannels != input->spec().nchannels) return info;
    info.mean.resize(std::size_t(last.nchannels));
    check_read(input->read_image(0, info.levels - 1, 0, last.nchannels, OIIO::TypeFloat, info.mean.data()), *input, path);
    return info;
}

}  // namespace sanguine
