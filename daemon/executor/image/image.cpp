#include "image/image.hpp"

#include <string_view>

namespace rtcf::executor {

ImageType imageTypeOf(const TypeInfo& type) {
    return {type.name, type.md5, type.size, type.alignment, type.flat};
}

bool same(const ImageType& image, const TypeInfo& type) {
    return image.name == type.name && image.md5 == type.md5 && image.size == type.size &&
           image.alignment == type.alignment && image.flat == type.flat;
}

}  // namespace rtcf::executor
