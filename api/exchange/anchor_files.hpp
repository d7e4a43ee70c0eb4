#pragma once

#include <string_view>

#include "api/kit/message.hpp"

namespace anchord::api {

struct ExchangeApi;

/// The published anchors that the request selects, as a file of another program: kml, gpkg, dxf, ifc, pnezd
/// or pozyx. Whole, without pages. A file that would leave out an anchor, or mix two systems, is refused
/// (422, `state`) with the anchors named: who builds on a drawing does not see what is missing.
Response anchor_file(ExchangeApi& api, std::string_view format, const Request& request);

}  // namespace anchord::api
