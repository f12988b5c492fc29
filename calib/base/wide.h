// Hot loops of plain arithmetic, compiled for the processors at hand.
#pragma once

// A function marked so is compiled twice and chosen when the program starts: with AVX2 and FMA where the processor has
// them, for the baseline of the architecture elsewhere. What it calls in its loops must be inlined to profit.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define TRIGPOINT_WIDE __attribute__((target_clones("arch=haswell", "default")))
#else
#define TRIGPOINT_WIDE
#endif
