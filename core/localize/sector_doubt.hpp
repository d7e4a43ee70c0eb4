#pragma once

#include "core/localize/joint_model.hpp"

namespace anchord {

/// Widens the positions of anchors whose ranges fit better if those from one side are late by a delay of
/// their own. A delay alike on all ranges of one side scatters nothing (scatter_doubt.hpp sees none of it):
/// place and bias take most of it in, and what remains in the residuals changes with the bearing.
///
/// Every sector of the bearing from the anchor, in steps of 15 degrees and with a tenth to nine tenths of
/// the ranges, is asked for its delay d >= 0 by one linear step from the solution, place and unit delay
/// free. The best one counts by its likelihood ratio with the scale free, 0.5 n ln(RSS without / RSS with),
/// n the ranges over their tempering: in full from 1 on, below 0.5 not at all. One sigma of the region then
/// reaches to where the anchor would be without that delay, and horizontally in every direction to 2 d / pi,
/// as far as d on half of the circle moves a least-squares place at most: where all anchors are late from
/// one side, lag and bias turn the way they moved. Where the loss of the fit rejects ranges of the sector, d
/// counts for less in that bound, by their weight in the fit against that of all others.
///
/// 960 made flights with 0.2 to 4 m on 15 to 70 % of the bearings: 97 % of their anchors are inside (63 %
/// without), and of those accepted 0.5 % are beyond 1.5 regions (14 % without); 100 clean ones claim 2 % more
/// and lose none.
///
/// Ranges with an error model have no part in it. Of `fit` only anchor_covariance grows.
/// returns  how many anchors became less certain by a tenth or more (root of the trace)
std::size_t add_sector_doubt(const FlightRows& flight, const FlightOptions& options, JointFit& fit);

/// The same of ranges that are late above some height, or below one (the edge of a roof, a beam, a slab),
/// where the tag climbed by half a metre. The heights of the tag are asked in twelve steps of as many ranges:
/// all from one step up, and all from one down. Anchors' heights rest on just that difference; one sigma
/// reaches to the height without that delay, in full from a likelihood ratio of 2.5 on, below 1.5 not at all.
/// Of 50 made anchors late by 0.15 to 0.3 m on the upper ring alone 45 were accepted beyond 1.5 regions, now
/// 17; honest ones claim nothing more. A lever arm that turns with the course looks alike: ask for that
/// first. returns  as add_sector_doubt
std::size_t add_level_doubt(const FlightRows& flight, const FlightOptions& options, JointFit& fit);

}  // namespace anchord
