#pragma once

#include <string>

#include "api/formats/report.hpp"

/// The tables and plates of the report; each is empty when there is nothing to show.
namespace anchord::report {

std::string positions(const Report& report);
std::string methods(const Report& report);   ///< linear, weighted least squares and joint side by side
std::string budgets(const Report& report);   ///< what each anchor's uncertainty comes from
std::string gates(const Report& report);     ///< every gate of every anchor, failed ones with their words
std::string goals(const Report& report);     ///< every anchor against its accuracy goal, and whose goal it is
std::string rejected(const Report& report);  ///< ranges not used, by reason
std::string flights(const Report& report);   ///< bias, lag and offset of the kit per flight
std::string iterations(const Report& report);  ///< Fig 8.10 and 8.11: raw against corrected
std::string residual_plots(const Report& report);

}  // namespace anchord::report
