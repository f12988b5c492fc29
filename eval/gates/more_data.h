// How much more data would about decide a gate that is undecided.
#pragma once

#include "eval/gates/gate.h"

namespace trigpoint {

// Fills in more_stations and more_runs from the measure's design: how many stations (each visited as often as those
// there), or runs past the same stations, would take the bound to the limit if the value stays as it is.
void MoreData(GateResult* result);

}  // namespace trigpoint
