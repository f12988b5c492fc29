// Is a median of squared errors larger than chance explains?
#pragma once

#include <cstddef>

namespace trigpoint {

// Whether, in less than one case of a thousand, so many of `count` independent errors, squared and divided by the
// median of their chi-square (`components` degrees of freedom), lie at `median` or above.
bool IsMedianTooLarge(double median, size_t count, size_t components);

}  // namespace trigpoint
