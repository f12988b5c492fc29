// Room for what ends the process where it gets no memory: Pango and the software renderer.
#pragma once

#include <string>

namespace trigpoint {

// Of address space, to draw a page of text and lines: 160 MiB with one of Pango's threads, and for each of two others
// that may live at the same time its stack (8 MiB) and the heap that is reserved for it (128 MiB).
constexpr double kPageMemory_mib = 440;

// Throws MemoryError where the limits of this process leave less address space than `needed_mib`. `what` is done with
// it: "drawing the report".
void RequireDrawingMemory(const std::string& what, double needed_mib);

}  // namespace trigpoint
