// Where a constraint error C goes in a velocity row  J v + bias + gamma lambda = 0.
//
// Baumgarte (paper eq. 20): bias = beta C / h, gamma = 0.
// Soft (paper eq. 22; Catto 2011): a spring and damper of frequency omega and damping ratio zeta, integrated implicitly:
//   k = m omega^2, c = 2 m zeta omega, m = 1/K with the *unsplit* K = J M^-1 J^T
//   gamma = 1/(h (c + h k)) = K / (h omega (2 zeta + h omega)),   bias = C h k gamma = C omega / (2 zeta + h omega)
// so that the fixed point does not depend on the mass splitting. A contact's own k and c go in as they are:
//   gamma = 1/(h (c + h k)),   bias = C k / (c + h k)
#pragma once
#include "../math/lane.h"

namespace cairn {
inline namespace CAIRN_ISA {

template <class F> CAIRN_HD F baumgarte_rate(F beta, F h) { return beta / h; }
template <class F> CAIRN_HD F soft_rate(F omega, F zeta, F h) { return omega / (F(2) * zeta + h * omega); }
// times K
template <class F> CAIRN_HD F soft_compliance(F omega, F zeta, F h) { return F(1) / (h * omega * (F(2) * zeta + h * omega)); }

template <class F> CAIRN_HD F spring_rate(F k, F c, F h) { return k / (c + h * k); }
template <class F> CAIRN_HD F spring_compliance(F k, F c, F h) { return F(1) / (h * (c + h * k)); }

} // namespace CAIRN_ISA
} // namespace cairn
