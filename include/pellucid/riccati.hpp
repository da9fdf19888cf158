// What a quadratic cost of a linear system comes to in the end: the discrete algebraic Riccati equation,
//
//   X = A' X (1 + G X)^-1 A + Q,   G = B R^-1 B' for control; A', C' R^-1 C for estimation,
//
// by doubling: k steps sum 2^k periods, so that their number is fixed and small.
//
// B. D. O. Anderson, "Second-order convergent algorithms for the steady-state Riccati equation", Int. J. Control 28,
// 1978; E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, "Structure-preserving algorithms for periodic discrete-time
// algebraic Riccati equations", Int. J. Control 77, 2004.
#pragma once

#include "symmetric_solve.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

template <class S, std::size_t N> SquareMatrix<S, N> zero_square() noexcept {
  SquareMatrix<S, N> m;
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t j = 0; j < N; ++j) m.at[i][j] = S(0);
  return m;
}
template <class S, std::size_t N> SquareMatrix<S, N> unit_square() noexcept {
  SquareMatrix<S, N> m = zero_square<S, N>();
  for (std::size_t i = 0; i < N; ++i) m.at[i][i] = S(1);
  return m;
}
template <class S, std::size_t N>
SquareMatrix<S, N> operator*(const SquareMatrix<S, N>& a, const SquareMatrix<S, N>& b) noexcept {
  SquareMatrix<S, N> m = zero_square<S, N>();
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t k = 0; k < N; ++k)
      for (std::size_t j = 0; j < N; ++j) m.at[i][j] = m.at[i][j] + a.at[i][k] * b.at[k][j];
  return m;
}
template <class S, std::size_t N>
SquareMatrix<S, N> operator+(const SquareMatrix<S, N>& a, const SquareMatrix<S, N>& b) noexcept {
  SquareMatrix<S, N> m;
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t j = 0; j < N; ++j) m.at[i][j] = a.at[i][j] + b.at[i][j];
  return m;
}
template <class S, std::size_t N> SquareMatrix<S, N> transposed(const SquareMatrix<S, N>& a) noexcept {
  SquareMatrix<S, N> m;
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t j = 0; j < N; ++j) m.at[i][j] = a.at[j][i];
  return m;
}
/// Without what rounding makes of a symmetric matrix.
template <class S, std::size_t N> SquareMatrix<S, N> symmetrised(const SquareMatrix<S, N>& a) noexcept {
  SquareMatrix<S, N> m;
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t j = 0; j < N; ++j) m.at[i][j] = S(0.5) * (a.at[i][j] + a.at[j][i]);
  return m;
}

/// a becomes 1, b becomes a^-1 b, c becomes a^-1 c: Gauss and Jordan, in every lane the largest pivot of a column
/// first.
template <class S, std::size_t N>
void divide(SquareMatrix<S, N>& a, SquareMatrix<S, N>& b, SquareMatrix<S, N>& c) noexcept {
  const auto exchange = [](const mask_t<S>& yes, S& x, S& y) {
    const S kept = x;
    x = select(yes, y, x);
    y = select(yes, kept, y);
  };
  for (std::size_t k = 0; k < N; ++k) {
    for (std::size_t i = k + 1; i < N; ++i) {
      const mask_t<S> larger = abs(a.at[i][k]) > abs(a.at[k][k]);
      if (!any(larger)) continue;
      for (std::size_t j = 0; j < N; ++j) {
        exchange(larger, a.at[k][j], a.at[i][j]);
        exchange(larger, b.at[k][j], b.at[i][j]);
        exchange(larger, c.at[k][j], c.at[i][j]);
      }
    }
    const S inverse = S(1) / a.at[k][k];
    for (std::size_t j = 0; j < N; ++j) {
      a.at[k][j] = a.at[k][j] * inverse;
      b.at[k][j] = b.at[k][j] * inverse;
      c.at[k][j] = c.at[k][j] * inverse;
    }
    for (std::size_t i = 0; i < N; ++i) {
      if (i == k) continue;
      const S share = a.at[i][k];
      for (std::size_t j = 0; j < N; ++j) {
        a.at[i][j] = a.at[i][j] - share * a.at[k][j];
        b.at[i][j] = b.at[i][j] - share * b.at[k][j];
        c.at[i][j] = c.at[i][j] - share * c.at[k][j];
      }
    }
  }
}

/// X of so many doublings: the cost of 2^doublings periods, which is that of all there will be if they are enough.
template <class S, std::size_t N>
SquareMatrix<S, N> riccati(SquareMatrix<S, N> a, SquareMatrix<S, N> g, SquareMatrix<S, N> q,
                           std::uint32_t doublings) noexcept {
  for (std::uint32_t k = 0; k < doublings; ++k) {
    SquareMatrix<S, N> factor = unit_square<S, N>() + g * q, onward = a, through = g;
    divide(factor, onward, through);  // (1 + G Q)^-1 A and G
    const SquareMatrix<S, N> back = transposed(a);
    g = symmetrised(g + a * through * back);
    q = symmetrised(q + back * q * onward);
    a = a * onward;
  }
  return q;
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
