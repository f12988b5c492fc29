#pragma once

#include <cstddef>

namespace trigpoint {

// Place of a cell in a grid that is kept row by row.
inline size_t CellIndex(int row, int col, int cols) {
  return static_cast<size_t>(row) * static_cast<size_t>(cols) + static_cast<size_t>(col);
}
inline size_t CellCount(int rows, int cols) { return CellIndex(rows, 0, cols); }

}  // namespace trigpoint
