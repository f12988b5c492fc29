// Room for what ends the process where it gets no memory: Pango and the software renderer.
#pragma once

#include <string>

namespace trigpoint {

constexpr double kPageMemory_mib = 160;  // of address space, to draw a page of text and lines

// Throws MemoryError where the limits of this process leave less address space than `needed_mib`. `what` is done with
// it: "drawing the report".
void RequireDrawingMemory(const std::string& what, double needed_mib);

}  // namespace trigpoint
