#pragma once

#include "core/types/campaign.hpp"

namespace anchord::flight {

/// A labelled campaign as an engineer would measure it before a flight in the demonstration building, with
/// the simulator's radio read as the tag reads it in flight: six environments of distances from 4 to 40 m,
/// height differences to 10 m and all headings, in the open, through glass and plasterboard, and through
/// brick and concrete. LOS is what the simulator calls so: less than 6 cm of delay on the straight line.
/// The same numbers each time.
Campaign demonstration_campaign();

}  // namespace anchord::flight
