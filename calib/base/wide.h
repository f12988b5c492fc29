// Hot loops of plain arithmetic, compiled for the processors at hand.
#pragma once

// A function marked so is compiled twice and chosen when the program starts: with AVX2 and FMA where the processor has
// them, for the baseline of the architecture elsewhere. What it calls in its loops must be inlined to profit. (A level
// of the architecture: the name of a processor, "arch=haswell", would be that processor alone.)
#if defined(__x86_64__) && defined(__GNUC__) && __GNUC__ >= 12 && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define TRIGPOINT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define TRIGPOINT_WIDE
#endif
