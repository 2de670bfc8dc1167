"""Writes extremes_reference.csv: densities, their gradients, transforms and distribution functions at extreme parameters and points, by
mpmath straight from the definitions, with so many digits that numbers 1e-300 and 1e300 fit beside one another.

Columns: kind, name, parameters and point (space-separated doubles, taken as such), values, region. Kinds:
* density: the log density; its region is `body`, or `tail` where an e-fold of distance from the centre holds less than e^-50 of the
  probability. What no double can hold is an infinity.
* gradient: its derivatives by the value, if that is continuous, and by the parameters; of some, such as bounds and integers, nan.
* from: at these coordinates, the value and the log Jacobian, last; to: of this value, the coordinates.
* covariance: a covariance function at a distance.
* hilbert: the log determinant and the condition of Hilbert's matrix of this size, its entries rounded to doubles.
* cdf: the distribution function, between 0.001 and 0.999; of integers, that of x + 1/2.

Run: python make_extremes_reference.py > extremes_reference.csv
"""

import make_dist_reference as ordinary
from mpmath import atan, erfc, exp, inf, isinf, isnan, log, log1p, loggamma, mp, mpf, nstr, pi, sqrt, tanh

mp.dps = 700
LARGEST = mpf(1.7976931348623157e308)
LEAST = mpf(5e-324)
SCALES = [1e-300, 1e-150, 1.0, 1e150, 1e300]
DISTANCES = [0.0, 1e-300, 1e-160, 1e-8, 0.7, -2.0, 6.0, -38.0, 1e3, 1e10, 1e140, -1e200]


def von_mises(x, m, k):
    from mpmath import besseli, cos

    if not -mpf(3.141592653589793) < x <= mpf(3.141592653589793):
        return -inf
    # Far out, the asymptotic series of I0.
    norm = -k - log(besseli(0, k)) if k < 1e4 else log(2 * pi * k) / 2 - log(series_i0(k))
    return k * (cos(x - m) - 1) - log(2 * pi) + (norm + 2 * k if k < 1e4 else norm)


def series_i0(k):
    term, total = mpf(1), mpf(1)
    for n in range(1, 60):
        term *= mpf(2 * n - 1) ** 2 / (8 * n * k)
        total += term
    return total


def mixture(x, a, b, m, s, n, t):
    one = lambda w, m, s: log(w / (a + b)) + ordinary.normal(x, m, s)
    first, second = one(a, m, s), one(b, n, t)
    most = max(first, second)
    return most + log(exp(first - most) + exp(second - most))


def truncated_normal(x, m, s, lo, hi):
    with mp.workdps(max(2000, mp.dps)):
        return ordinary.normal(x, m, s) - log(ordinary.phi_integral((lo - m) / s, (hi - m) / s)) if lo <= x <= hi else -inf


def scaled(*families):
    """Location 0, far points and near ones in units of the scale."""
    return [(p, [s * z for z in DISTANCES if abs(s * z) < 1e308] + [1e-300, -1e300]) for s in SCALES for p in [f(s) for f in families]]


def grid(parameters, points):
    return [(p, points) for p in parameters]


SHARES = [1e-320, 1e-300, 1e-160, 1e-20, 1e-8, 0.3, 0.5, 0.9999999999999999]
POSITIVE = [1e-320, 1e-300, 1e-200, 1e-150, 1e-20, 1e-3, 0.5, 1.0, 2.5, 40.0, 1e6, 1e20, 1e150, 1e300]
COUNTS = [0.0, 1.0, 2.0, 40.0, 1e3, 1e6, 1e12, 9e15]
ANGLES = [0.0, 1e-300, -1e-150, 1e-8, 0.5, -2.0, 3.141592653589793, -3.1415926535897927]

# By family: the density, where the body lies, which parameters are integers, whether it is discrete, parameters with their points.
DENSITIES = {
    "normal": (ordinary.normal, lambda m, s: m, [], False, scaled(lambda s: (0.0, s)) + grid([(1e300, 1e299), (-1e300, 1e290)], [1e300, 0.0, -1e300, 1.1e300])),
    "lognormal": (ordinary.lognormal, lambda m, s: 0, [], False, grid([(0, 1), (600, 1e-3), (-600, 30), (1e300, 1e300), (0, 1e-300), (0, 1e300)], POSITIVE)),
    "uniform": (ordinary.uniform, lambda a, b: a, [0, 1], False, grid([(0, 1e-300), (-1e300, 1e300), (0, 5e-324), (1, 1.0000000000000002), (-8e307, 8e307), (1e300, 1.1e300)], [0.0, 5e-324, 1e-300, 1.0, 1e300, -1e300, 2.0])),
    "beta": (ordinary.beta_, lambda a, b: 0, [], False, grid([(0.01, 0.01), (1e-300, 1e-300), (1e-300, 1), (1, 1e300), (1e300, 1e300), (1e-10, 1e10), (1e150, 2e150), (3, 1e20), (1e16, 0.5), (2, 2)], SHARES)),
    "gamma": (ordinary.gamma_, lambda a, b: 0, [], False, grid([(1e-3, 1), (1e-300, 1), (1e-300, 1e300), (1, 1e-300), (2, 1e300), (1e20, 1), (1e150, 1e150), (1e300, 1e300), (1e300, 1), (0.5, 1e-150)], POSITIVE)),
    "exponential": (ordinary.exponential, lambda a: 0, [], False, grid([(s,) for s in SCALES], [0.0] + POSITIVE)),
    "half_normal": (ordinary.half_normal, lambda s: 0, [], False, grid([(s,) for s in SCALES], [0.0] + POSITIVE)),
    "half_cauchy": (ordinary.half_cauchy, lambda m, s: m, [0], False, grid([(0, s) for s in SCALES] + [(-1e300, 1e300), (1e300, 1.0)], [0.0] + POSITIVE)),
    "student_t": (ordinary.student_t, lambda v, m, s: m, [], False, scaled(lambda s: (1e-3, 0.0, s), lambda s: (4.0, 0.0, s)) + grid([(1e-300, 0, 1), (1e300, 0, 1), (1e16, 1, 1e-3), (1e-10, 1e300, 1e300)], [0.0, 1e-300, 0.7, -3.0, 40.0, 1e10, 1e300])),
    "inv_gamma": (ordinary.inv_gamma, lambda a, b: 0, [], False, grid([(1e-3, 1), (1e-300, 1), (1e-300, 1e300), (1, 1e-300), (2, 1e300), (1e20, 1e20), (1e150, 1e150), (1e300, 1e300), (0.5, 1e-150)], POSITIVE)),
    "cauchy": (ordinary.cauchy, lambda m, s: m, [], False, scaled(lambda s: (0.0, s)) + grid([(1e300, 1e300), (-1e300, 1.0)], [0.0, 1e300, -1e300])),
    "laplace": (ordinary.laplace, lambda m, s: m, [], False, scaled(lambda s: (0.0, s)) + grid([(1e300, 1e300), (-1e300, 1.0)], [0.0, 1e300, -1e300])),
    "von_mises": (von_mises, lambda m, k: m, [], False, grid([(0, 0), (0, 1e-300), (0.5, 1e-10), (0.5, 50), (0.5, 1e10), (0, 1e16), (0, 1e150), (0, 1e300), (0.5, 1e300)], ANGLES)),
    "weibull": (ordinary.weibull, lambda k, s: 0, [], False, grid([(1e-2, 1), (1e-300, 1), (1, 1e-300), (1, 1e300), (2, 1e-150), (1e5, 1), (1e10, 2.5), (0.5, 1e150)], POSITIVE)),
    "truncated_normal": (truncated_normal, lambda m, s, a, b: a if a > -inf else m, [2, 3], False, grid(
        [(0, 1, -inf, inf), (0, 1, 0, inf), (0, 1, 38, inf), (0, 1, 1e10, inf), (0, 1, 1e140, inf), (0, 1, -inf, -1e10), (0, 1e300, -1e300, 1e300), (0, 1e-300, 0, 1e-300),
         (0, 1e-300, -1e-299, 1e-160), (0, 1, -1e-300, 1e-300), (0, 1, 40, 40.1), (1e300, 1e299, 0, 1e300), (0, 1, 1, 1.0000000000000002), (0, 1, -1e-10, 1e140)],
        [0.0, 1e-300, 5e-301, -1e-299, 1e-160, 0.5, 1.0, 38.0, 38.5, 40.0, 40.05, 60.0, 1e10, 10000000000.1, -1e10, 1e140, 1.1e140, 1e299, 9.5e299, -1e300])),
    "neg_binomial": (ordinary.neg_binomial, lambda r, p: 0, [], True, grid([(1e-300, 0.5), (1e-300, 1e-300), (1e300, 1), (1e15, 1e-3), (3, 1e-300), (1e150, 0.5), (0.5, 1e-15), (2, 0.9999999999999999)], COUNTS)),
    "geometric": (ordinary.geometric, lambda p: 0, [], True, grid([(1e-300,), (1e-15,), (0.9999999999999999,), (1,), (0.5,)], COUNTS)),
    "poisson": (ordinary.poisson, lambda r: 0, [], True, grid([(0,), (5e-324,), (1e-300,), (1e-10,), (1.0,), (1e6,), (1e12,), (9e15,)], COUNTS)),
    "binomial": (ordinary.binomial, lambda n, p: 0, [0], True, grid([(9e15, 1e-300), (9e15, 1e-15), (9e15, 0.5), (9e15, 0.9999999999999999), (40, 1e-300), (1e6, 1), (1e12, 1e-6)], COUNTS)),
    "uniform_discrete": (ordinary.uniform_discrete, lambda a, b: 0, [0, 1], True, grid([(0, 9e15), (-9e15, 9e15), (9e15, 9e15)], COUNTS)),
    "mixture": (mixture, lambda *p: p[2], list(range(6)), False, grid(
        [(1, 1e-300, 0, 1, 1e3, 1), (1, 1, -1e300, 1e299, 1e300, 1e299), (1e300, 1e-300, 0, 1e-150, 0, 1e150), (1, 1, 0, 1e-300, 0, 1e300)],
        [0.0, 1e-300, 0.5, 40.0, 1e3, -1e3, 1e150, 1e300, -1e300])),
}

# Of several numbers.
MORE = {
    "dirichlet": (ordinary.dirichlet, [(1e-300, 1e-300, 1e-300), (1e300, 1e300, 1e300), (1e-3, 1, 1e3), (1e150, 1e-150, 1), (0.5, 0.5, 0.5)],
                  [(0.25, 0.25, 0.5), (1e-300, 0.5, 0.5), (1e-300, 1e-320, 1.0), (2**-40, 0.5, 0.5 - 2**-40)]),
    "multinomial": (ordinary.multinomial, [(1e15, 1, 1, 1), (1e15, 1e-300, 1e300, 1), (3, 1e-300, 1e-300, 1e-300), (0, 1e300, 1e-300, 1)],
                    [(0, 0, 0), (1, 1, 1), (0, 1e15, 0), (1e15, 0, 0), (2e14, 3e14, 5e14), (3, 0, 0)]),
    "lkj": (ordinary.lkj, [(3, 1e-300), (3, 1e-3), (3, 1e20), (3, 1e300)], ordinary.LKJ3 + [(1, 0, 0, 0, 1, 0, 1, 1e-160, 1e-160)]),
    "wishart": (ordinary.wishart, [(2.0000001, 1, 0, 0, 0, 1, 0, 0, 0, 1), (3, 1e-100, 0, 0, 1e-100, 1e100, 0, 0, 0, 1), (1e15, 1, 0, 0, 0, 1, 0, 0, 0, 1)],
                ordinary.W3 + [(1e-100, 0, 0, 0, 1e-100, 0, 0, 0, 1e-100), (1e100, 0, 0, 1e100, 1e100, 0, 0, 0, 1e100)]),
}


def expit(y):
    return 1 / (1 + exp(-y))


def simplex(ys):
    """Stick breaking as in the Stan reference manual: equal shares at 0."""
    n, rest, xs, jacobian = len(ys) + 1, mpf(1), [], mpf(0)
    for k, y in enumerate(ys):
        z = expit(y - log(mpf(n - 1 - k)))
        xs.append(rest * z)
        jacobian += log(rest) + log(z) + log(1 - z)
        rest *= 1 - z
    return xs + [rest], jacobian


def correlation(ys):
    """Three rows; canonical partial correlations tanh y."""
    z = [tanh(y) for y in ys]
    q = [1 - t * t for t in z]
    xs = [mpf(1), mpf(0), mpf(0), z[0], sqrt(q[0]), mpf(0), z[1], z[2] * sqrt(q[1]), sqrt(q[1] * q[2])]
    return xs, sum(map(log, q)) + log(q[1]) / 2


def covariance(ys):
    """Two rows: a logarithm on the diagonal."""
    return [exp(ys[0]), mpf(0), ys[1], exp(ys[2])], ys[0] + ys[2]


def ascending(ys):
    return [ys[0], ys[0] + exp(ys[1]), ys[0] + exp(ys[1]) + exp(ys[2])], ys[1] + ys[2]


# Coordinates of numbers, and those of several.
FAR = [0.0, 1e-300, -1e-300, 1e-16, 0.5, -0.5, 3.0, -3.0, 20.0, -20.0, 36.5, -36.5, 40.0, -40.0, 300.0, -300.0, 699.0, -699.0]
TRIPLES = [(0.0, 0.0, 0.0), (1e-300, -1e-300, 1e-16), (3.0, -2.0, 0.5), (30.0, 1.0, -1.0), (-40.0, 0.25, 30.0), (200.0, 150.0, -300.0), (-340.0, 1.0, -300.0)]
NUMBERS = {
    "positive": (lambda y: (exp(y), y), lambda x: log(x), [()]),
    "at_least": (lambda y, a: (a + exp(y), y), lambda x, a: log(x - a), [(0.0,), (-3.0,), (1e300,), (1e-300,)]),
    "at_most": (lambda y, a: (a - exp(y), y), lambda x, a: log(a - x), [(0.0,), (4.0,), (-1e300,), (1e-300,)]),
    "interval": (lambda y, a, b: (a + (b - a) * expit(y), log(b - a) + log(expit(y)) + log(expit(-y))), lambda x, a, b: log(x - a) - log(b - x),
                 [(0.0, 1.0), (-1.0, 0.0), (-1e300, 1e300), (0.0, 1e-300), (1e-300, 1e300), (5.0, 5.0000001)]),
}
SEVERAL = {"simplex": simplex, "correlation": correlation, "covariance": covariance, "ascending": ascending}


def norm_cdf(z):
    return erfc(-z / sqrt(2)) / 2


def gamma_cdf(x, a):
    """By its series of positive terms."""
    if x > a + 50 * sqrt(a) + 500:
        return mpf(1)
    term, total, n = mpf(1), mpf(1), 0
    while term > mpf(10) ** -40 * total:
        n += 1
        term *= x / (a + n)
        total += term
    return exp(a * log(x) - x - loggamma(a + 1)) * total


def beta_cdf(x, a, b):
    """By its continued fraction, where that converges fast."""
    if not 0 < x < 1:
        return mpf(x >= 1)
    if x * (a + b + 2) > a + 1:
        return 1 - beta_cdf(1 - x, b, a)
    f, c, d, m = mpf(1), mpf(1), mpf(0), 0
    while True:
        k = m // 2
        step = -(a + k) * (a + b + k) * x / ((a + m) * (a + m + 1)) if m % 2 == 0 else (k + 1) * (b - k - 1) * x / ((a + m) * (a + m + 1))
        d, c, m = 1 / (1 + step * d), 1 + step / c, m + 1
        f *= c * d
        if abs(c * d - 1) < mpf(10) ** -40:
            return exp(a * log(x) + b * log(1 - x) - ordinary.lnbeta(a, b)) / (a * f)


def t_cdf(x, v, m, s):
    z = (x - m) / s
    tail = beta_cdf(v / (v + z * z), v / 2, mpf(1) / 2) / 2 if z != 0 else mpf(1) / 2
    return tail if z < 0 else 1 - tail


def between(x, m, s, a, b):
    part = ordinary.phi_integral
    return part((a - m) / s, (x - m) / s) / part((a - m) / s, (b - m) / s)


POWERS = [10.0**k for k in range(-300, 301, 15)]
SHAPES = [c * 10.0**k for k in range(-20, 21) for c in (1, 2, 5)]
AROUND = [-1e3, -10.0, -2.0, -1.0, -0.5, -0.1, 0.0, 0.2, 0.7, 1.5, 2.5, 5.0, 100.0]
CDFS = {
    "normal": (lambda x, m, s: norm_cdf((x - m) / s), [((0, s), [s * z for z in AROUND]) for s in SCALES]),
    "lognormal": (lambda x, m, s: norm_cdf((log(x) - m) / s), [((0, 300), POWERS), ((500, 1e-3), [exp(mpf(500) + mpf(k) / 1000) for k in range(-3, 4)]), ((-100, 100), POWERS)]),
    "uniform": (lambda x, a, b: (x - a) / (b - a), [((-8e307, 8e307), [-7e307, -1e306, 0.0, 3e307, 7.9e307]), ((0, 1e-300), [1e-302, 2e-301, 7e-301]), ((0, 1e-320), [1e-321, 5e-321, 8e-321])]),
    "beta": (beta_cdf, [((0.01, 0.01), POWERS[:20] + [0.1, 0.5, 0.9, 0.9999]), ((1e-3, 1), POWERS[:21]), ((0.5, 1e6), SHAPES[:60]), ((2, 1e20), SHAPES), ((1e6, 1e6), [0.499, 0.4995, 0.5, 0.5002, 0.501]), ((0.02, 40), POWERS[:21])]),
    "gamma": (lambda x, a, r: gamma_cdf(r * x, a), [((1e-3, 1), POWERS), ((0.01, 1e-200), POWERS), ((0.5, 1e300), [1e-300 * c for c in SHAPES]), ((2, 1e-300), [1e300 * c for c in SHAPES[:63]]), ((1e6, 1), [997e3, 999e3, 1e6, 1001e3, 1002e3])]),
    "exponential": (lambda x, r: 1 - exp(-r * x), [((s,), [c / s for c in (0.01, 0.1, 0.5, 1.0, 2.0, 4.0)]) for s in SCALES]),
    "half_normal": (lambda x, s: 1 - 2 * norm_cdf(-x / s), [((s,), [c * s for c in (0.01, 0.1, 0.5, 1.0, 2.0, 3.0)]) for s in SCALES]),
    "half_cauchy": (lambda x, m, s: 2 / pi * atan((x - m) / s), [((0, s), [c * s for c in (0.01, 0.1, 1.0, 10.0, 100.0)]) for s in SCALES]),
    "student_t": (t_cdf, [((1e-2, 0, 1), POWERS + [-p for p in POWERS]), ((0.5, 0, 1e-150), [1e-150 * c for c in SHAPES] + [-1e-150 * c for c in SHAPES]), ((3, 0, 1e300), [1e300 * c for c in AROUND]), ((1e10, 0, 1e-300), [1e-300 * c for c in AROUND])]),
    "inv_gamma": (lambda x, a, s: 1 - gamma_cdf(s / x, a), [((1e-3, 1), POWERS), ((0.01, 1e200), POWERS), ((0.5, 1e-300), [1e-300 * c for c in SHAPES]), ((3, 1e300), [1e300 * c for c in SHAPES[:63]])]),
    "cauchy": (lambda x, m, s: mpf(1) / 2 + atan((x - m) / s) / pi, [((0, s), [c * s for c in AROUND]) for s in SCALES]),
    "laplace": (lambda x, m, s: exp((x - m) / s) / 2 if x < m else 1 - exp((m - x) / s) / 2, [((0, s), [c * s for c in AROUND]) for s in SCALES]),
    "weibull": (lambda x, k, s: 1 - exp(-((x / s) ** k)), [((0.005, 1), POWERS), ((1e3, 1e300), [1e300 * c for c in (0.994, 0.998, 0.9995, 1.0, 1.001)]), ((1, 1e-300), [1e-300 * c for c in SHAPES])]),
    "truncated_normal": (between, [((0, 1, 38, 1e10), [38.001, 38.005, 38.01, 38.03, 38.1]), ((0, 1, 1e5, 2e8), [1e5 + c * 1e-5 for c in (0.1, 0.5, 1.0, 2.0)]), ((0, 1e-300, 1e-300, 2e-300), [1.1e-300, 1.4e-300, 1.8e-300]),
                                   ((0, 1e300, -1e299, 1e299), [-9e298, -1e298, 3e298, 9.5e298]), ((0, 1, -1e-300, 3e-300), [0.0, 1e-300, 2.5e-300]), ((0, 1e-3, 1, 2), [1.0 + c * 1e-7 for c in (2.0, 10.0, 30.0)])]),
    "geometric": (lambda k, p: 1 - exp((k + 1) * log1p(-p)), [((1e-15,), [1e13, 1e14, 5e14, 1e15, 3e15]), ((1e-6,), [1e4, 1e5, 1e6, 3e6]), ((0.99,), [0.0])]),
    "poisson": (lambda k, r: 1 - gamma_cdf(r, k + 1), [((1e-2,), [0.0]), ((1e3,), [950.0, 980.0, 1e3, 1020.0, 1050.0]), ((1e6,), [998e3, 999500.0, 1e6, 1001e3, 1002e3])]),
    "binomial": (lambda k, n, p: beta_cdf(1 - p, n - k, k + 1), [((1e4, 1e-3), [4.0, 7.0, 10.0, 13.0, 18.0]), ((1e6, 0.5), [499e3, 499700.0, 5e5, 500400.0, 501e3]), ((1e6, 0.9999999), [999998.0, 999999.0])]),
    "neg_binomial": (lambda k, r, p: beta_cdf(p, r, k + 1), [((0.05, 1e-6), [0.0, 10.0, 1e3, 1e5, 1e6, 3e6]), ((50, 0.5), [30.0, 45.0, 50.0, 60.0, 75.0]), ((0.01, 0.5), [0.0])]),
}


def periodic(d, period, length, sd):
    from mpmath import fmod, sin

    return sd**2 * exp(-2 * (sin(pi * fmod(d, period) / period) / length) ** 2)


def matern32(d, length, sd):
    r = sqrt(3) * d / length
    return sd**2 * (1 + r) * exp(-r)


def matern52(d, length, sd):
    r = sqrt(5) * d / length
    return sd**2 * (1 + r + r * r / 3) * exp(-r)


COVARIANCES = {
    "sq_exp": (lambda d, length, sd: sd**2 * exp(-(d / length) ** 2 / 2), SIZES := [(1e-300, 1.0), (1e-6, 1e-150), (1.0, 1.0), (1e6, 1e150), (1e300, 1.0)]),
    "matern32": (matern32, SIZES),
    "matern52": (matern52, SIZES),
    "periodic": (periodic, [(1.0, 1e-6, 1.0), (1e-300, 1.0, 1.0), (7.0, 0.3, 1e150), (1e300, 1.0, 1e-150), (1.0, 1e300, 1.0), (3.0, 1e-3, 1.0)]),
}


def covariances():
    for name, (f, parameters) in COVARIANCES.items():
        for ps in parameters:
            unit = ps[0]
            near = [unit * c for c in (1e-6, 1e-3, 0.3, 0.999999, 0.9999999999, 1.0, 2.5, 6.0, 36.0)]
            for d in dict.fromkeys([0.0, 1e-300, 1e-150, 1e-6, 1.0, 1e6, 1e150, 1e300] + [d for d in near if 0 < d < 1e308]):
                row("covariance", name, ps, [d], [f(mpf(d), *exact(ps))])


def hilberts():
    """The condition in the norm of 2; from a size of 13 on the rounded matrix need not be positive definite: then no determinant."""
    from mpmath import eigsy, matrix

    for n in range(1, 17):
        m = matrix(n, n)
        for i in range(n):
            for j in range(n):
                m[i, j] = mpf(1.0 / (i + j + 1))
        values = eigsy(m, eigvals_only=True)
        least, most = min(values), max(values)
        row("hilbert", "hilbert", [], [n], [sum(map(log, values)) if least > 0 else mpf("nan"), most / least if least > 0 else inf])


def shown(x):
    """To 20 digits, as the nearest infinity where no double is that large, as 0 where none is that small."""
    x = mpf(x)
    if isnan(x):
        return "nan"
    if abs(x) > LARGEST:
        return "inf" if x > 0 else "-inf"
    return "0.0" if abs(x) < LEAST / 2 else nstr(x, 20, strip_zeros=False)


def doubles(xs):
    return " ".join(repr(float(x)) for x in xs)


def row(kind, name, parameters, point, values, region=""):
    print(f"{kind},{name},{doubles(parameters)},{doubles(point)},{' '.join(map(shown, values))},{region}")


def exact(xs):
    return tuple(mpf(float(x)) for x in xs)


def densities():
    for name, (f, centre, integers, discrete, cases) in DENSITIES.items():
        for ps, points in cases:
            p, c = exact(ps), centre(*map(float, ps))
            for x in dict.fromkeys(map(float, points)):
                exactly = mpf(x)
                y = f(exactly, *p)
                away = abs(exactly - mpf(c))
                body = y > -50 if away == 0 or discrete else y + log(away) > -50
                row("density", name, ps, [x], [y], "body" if body else "tail")
                if isinf(y) or abs(y) > LARGEST or (not discrete and name == "mixture"):
                    continue
                slopes = []
                inside = name not in ("uniform", "half_cauchy", "truncated_normal", "half_normal", "exponential", "laplace") or f(exactly * (1 - mpf(2) ** -900) - mpf(2) ** -2000, *p) > -inf and f(exactly * (1 + mpf(2) ** -900) + mpf(2) ** -2000, *p) > -inf
                # At a kink, and where the density is narrower than the step below.
                if not inside or (name == "laplace" and away == 0) or (name == "lognormal" and ps[1] < 1e-200):
                    continue
                with mp.workdps(1500):
                    if not discrete:
                        slopes.append(derivative(lambda x: f(x, *p), exactly))
                    for i in range(len(p)):
                        known = i not in integers and not isinf(p[i])
                        slopes.append(derivative(lambda v: f(exactly, *p[:i], v, *p[i + 1 :]), p[i]) if known else mpf("nan"))
                if None not in slopes:
                    row("gradient", name, ps, [x], slopes, "body" if body else "tail")


def derivative(f, at):
    """By a step far below the number, or, at 0, far below all doubles; none at an end of the parameters."""
    h = abs(at) * mpf(10) ** -300 if at != 0 else mpf(10) ** -620
    try:
        up, down = f(at + h), f(at - h)
    except ValueError:
        return None
    if any(isinf(v) or not hasattr(v, "_mpf_") for v in (up, down)):
        return None
    return (up - down) / (2 * h)


def several():
    for name, (f, parameters, points) in MORE.items():
        for ps in parameters:
            for x in points:
                y = f(exact(x), *exact(ps))
                row("density", name, ps, x, [y], "body" if y > -50 else "tail")


def transforms():
    for name, (forth, back, cases) in NUMBERS.items():
        for ps in cases:
            p = exact(ps)
            for y in FAR:
                x, jacobian = forth(mpf(y), *p)
                row("from", name, ps, [y], [x, jacobian])
                inside = {"at_least": lambda x, a: x > a, "at_most": lambda x, a: x < a, "interval": lambda x, a, b: a < x < b, "positive": lambda x: x > 0}
                rounded = float(x)
                if inside[name](rounded, *map(float, ps)):
                    row("to", name, ps, [rounded], [back(mpf(rounded), *p)])
    for name, f in SEVERAL.items():
        for y in TRIPLES:
            xs, jacobian = f(exact(y))
            row("from", name, [], y, [*xs, jacobian])


def cdfs():
    for name, (f, cases) in CDFS.items():
        for ps, points in cases:
            for x in dict.fromkeys(float(x) for x in points):
                y = f(mpf(x), *exact(ps))
                if 0.001 < y < 0.999:
                    row("cdf", name, ps, [x], [y])


if __name__ == "__main__":
    print("kind,name,parameters,point,values,region")
    densities()
    several()
    transforms()
    covariances()
    with mp.workdps(60):
        hilberts()
        cdfs()
