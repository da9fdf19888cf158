// Small symmetric systems: factors L D L', and what they solve.
#pragma once

#include "math.hpp"

namespace pellucid {
inline namespace PELLUCID_ABI {

/// A matrix that uses as many rows as it is told; the rest is not touched.
template <class S, std::size_t N> struct SquareMatrix {
  S at[N][N];
};

/// L D L' of a symmetric matrix, in its lower triangle, which alone is read; D as its inverse on the diagonal.
template <class S, std::size_t N> void factorise(SquareMatrix<S, N>& m, std::size_t n) noexcept {
  for (std::size_t j = 0; j < n; ++j) {
    S pivot = m.at[j][j];
    for (std::size_t k = 0; k < j; ++k) {
      const S scaled = m.at[j][k];  // L_jk D_k
      m.at[j][k] = scaled * m.at[k][k];
      pivot = pivot - scaled * m.at[j][k];
    }
    m.at[j][j] = S(1) / pivot;
    for (std::size_t i = j + 1; i < n; ++i)
      for (std::size_t k = 0; k < j; ++k) m.at[i][j] = m.at[i][j] - m.at[i][k] * m.at[j][k];
  }
}

/// The same of a matrix that need not be definite: what hangs on others to a part in 10^10 counts as not there.
template <class S, std::size_t N> void factorise_where_definite(SquareMatrix<S, N>& m, std::size_t n) noexcept {
  for (std::size_t j = 0; j < n; ++j) {
    const S whole = m.at[j][j];
    S pivot = whole;
    for (std::size_t k = 0; k < j; ++k) {
      const S scaled = m.at[j][k];
      m.at[j][k] = scaled * m.at[k][k];
      pivot = pivot - scaled * m.at[j][k];
    }
    const mask_t<S> definite = pivot > S(static_cast<value_t<S>>(sizeof(value_t<S>) == 8 ? 1e-10 : 1e-4)) * whole;
    m.at[j][j] = select(definite, S(1) / select(definite, pivot, S(1)), S(0));
    for (std::size_t i = j + 1; i < n; ++i)
      for (std::size_t k = 0; k < j; ++k) m.at[i][j] = m.at[i][j] - m.at[i][k] * m.at[j][k];
  }
}

/// x becomes what the matrix, multiplied by it, gives x.
template <class S, std::size_t N> void solve(const SquareMatrix<S, N>& factors, std::size_t n, S* x) noexcept {
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < i; ++k) x[i] = x[i] - factors.at[i][k] * x[k];
  for (std::size_t i = n; i-- > 0;) {
    x[i] = x[i] * factors.at[i][i];
    for (std::size_t k = i + 1; k < n; ++k) x[i] = x[i] - factors.at[k][i] * x[k];
  }
}

}  // namespace PELLUCID_ABI
}  // namespace pellucid
