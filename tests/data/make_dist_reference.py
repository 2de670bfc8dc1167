"""Writes dist_reference.csv: log densities to 25 digits, by mpmath with 60 digits, straight from the definitions.

Columns: family, parameters (space-separated doubles), point, log density. The inputs are taken as doubles.
Run: python make_dist_reference.py > dist_reference.csv
"""

from mpmath import inf, log, loggamma, mp, mpf, nstr, pi, sqrt

mp.dps = 60


def lnbeta(a, b):
    return loggamma(a) + loggamma(b) - loggamma(a + b)


def normal(x, m, s):
    return -(((x - m) / s) ** 2) / 2 - log(s) - log(2 * pi) / 2


def lognormal(x, m, s):
    return normal(log(x), m, s) - log(x) if x > 0 else -inf


def uniform(x, lo, hi):
    return -log(hi - lo) if lo <= x <= hi else -inf


def power(k, x):
    """k ln x with its limits."""
    if k == 0:
        return mpf(0)
    if x == 0:
        return -inf if k > 0 else inf
    return k * log(x)


def beta_(x, a, b):
    if not 0 <= x <= 1:
        return -inf
    return power(a - 1, x) + power(b - 1, 1 - x) - lnbeta(a, b)


def gamma_(x, shape, rate):
    return (shape - 1) * log(x) + shape * log(rate) - rate * x - loggamma(shape) if x > 0 else -inf


def exponential(x, rate):
    return log(rate) - rate * x if x >= 0 else -inf


def half_normal(x, s):
    return normal(x, 0, s) + log(2) if x >= 0 else -inf


def half_cauchy(x, m, s):
    return log(2 / (pi * s)) - log(1 + ((x - m) / s) ** 2) if x >= m else -inf


def student_t(x, df, m, s):
    z = (x - m) / s
    return loggamma((df + 1) / 2) - loggamma(df / 2) - log(df * pi) / 2 - log(s) - (df + 1) / 2 * log(1 + z * z / df)


def uniform_discrete(x, lo, hi):
    return -log(hi - lo + 1) if lo <= x <= hi and x == int(x) else -inf


def binomial(k, n, p):
    if not 0 <= k <= n or k != int(k):
        return -inf
    return -log(n + 1) - lnbeta(k + 1, n - k + 1) + power(k, p) + power(n - k, 1 - p)


def poisson(k, rate):
    return power(k, rate) - rate - loggamma(k + 1) if k >= 0 and k == int(k) else -inf


def phi_integral(a, b):
    """Of the standard normal density; far out by erfc of the far side, where nothing cancels."""
    from mpmath import erf, erfc

    if a >= 0:
        return (erfc(a / sqrt(2)) - erfc(b / sqrt(2))) / 2
    if b <= 0:
        return phi_integral(-b, -a)
    return (erf(b / sqrt(2)) - erf(a / sqrt(2))) / 2


def truncated_normal(x, m, s, lo, hi):
    if not lo <= x <= hi:
        return -inf
    with mp.workdps(2000 if max(lo - m, m - hi) > 40 * s else 120):
        return normal(x, m, s) - log(phi_integral((lo - m) / s, (hi - m) / s))


def inv_gamma(x, shape, scale):
    return shape * log(scale) - loggamma(shape) - (shape + 1) * log(x) - scale / x if x > 0 else -inf


def cauchy(x, m, s):
    return -log(pi * s) - log(1 + ((x - m) / s) ** 2)


def laplace(x, m, s):
    return -log(2 * s) - abs(x - m) / s


def von_mises(x, m, k):
    from mpmath import besseli, cos

    # The doubles are inside (-pi, pi] if they are at most the double nearest to pi, which is below pi.
    if not -mpf(3.141592653589793) < x <= mpf(3.141592653589793):
        return -inf
    with mp.workdps(120):
        return k * cos(x - m) - log(2 * pi) - log(besseli(0, k))


def weibull(x, k, s):
    return log(k / s) + (k - 1) * log(x / s) - (x / s) ** k if x > 0 else -inf


def neg_binomial(k, r, p):
    if k < 0 or k != int(k):
        return -inf
    return -log(r + k) - lnbeta(r, k + 1) + power(r, p) + power(k, 1 - p)


def geometric(k, p):
    return log(p) + power(k, 1 - p) if k >= 0 and k == int(k) else -inf


def flat(x):
    return mpf(0)


FAMILIES = {
    "normal": (normal, [(0, 1), (1.5, 0.25), (-1e6, 1e-3), (1e-8, 1e8), (0, 1e-150)], [0, 0.3, -1.7, 40, -40, 1e10, 1.5]),
    "lognormal": (lognormal, [(0, 1), (2, 0.1), (-5, 3)], [0, 1e-300, 1e-5, 0.5, 1, 7.389, 1e10, 1e300, -1]),
    "uniform": (uniform, [(0, 1), (-3, 1e6), (1, 1.0000001)], [0, 1, 0.5, -3, 1e6, 1.00000005, 2, -0.001]),
    "beta": (
        beta_,
        [(0.01, 0.01), (1, 1), (2, 3), (0.5, 1), (1, 2.5), (63, 64), (64, 70), (1e6, 2e6), (1e-3, 1e9), (1e9, 1e9), (5, 1e7)],
        [0, 1e-300, 1e-12, 0.01, 0.3, 0.33333, 0.5, 0.50001, 0.999, 0.9999999999999999, 1, 1.5, -0.1],
    ),
    "gamma": (
        gamma_,
        [(1e-3, 1), (0.5, 2), (1, 1), (2, 1e-6), (3.7, 12), (63, 1), (64, 0.5), (1e6, 1), (1e9, 1e3)],
        [0, 1e-300, 1e-5, 0.1, 1, 3.3, 60, 1e3, 1e6, 1000100, 1e300, -1],
    ),
    "exponential": (exponential, [(1,), (1e-6,), (250,)], [0, 1e-300, 0.5, 3, 700, 1e10, -1e-9]),
    "half_normal": (half_normal, [(1,), (1e-3,), (1e5,)], [0, 0.5, 3, 40, 1e6, -0.1]),
    "half_cauchy": (half_cauchy, [(0, 1), (-2, 0.1), (5, 1e3)], [0, 0.5, 5, 1e4, 1e200, -2, -2.5]),
    "student_t": (
        student_t,
        [(1e-3, 0, 1), (1, 0, 1), (2.5, 1, 0.1), (30, -4, 7), (1e8, 0, 1), (1e15, 1, 2)],
        [0, 0.1, -4, 40, 1e5, -1e10, 1e200],
    ),
    "uniform_discrete": (uniform_discrete, [(1, 6), (-3, -3), (0, 1e9)], [1, 6, 0, 7, 2.5, -3, 1e9]),
    "binomial": (
        binomial,
        [(0, 0.3), (1, 0.5), (20, 0), (20, 1), (20, 0.3), (20, 1e-9), (1000, 0.999), (1e9, 0.5), (1e12, 1e-9), (1e15, 0.1)],
        [0, 1, 6, 14, 20, 2.5, -1, 500, 999, 1000, 5e8, 499990000, 1e14, 1e15],
    ),
    "truncated_normal": (
        truncated_normal,
        [(0, 1, -inf, inf), (0, 1, 0, inf), (1, 2, -1, 3), (0, 1, 30, inf), (0, 1, 30, 30.5), (-30, 0.5, 0, 1e3), (0, 1, 300, 300.000001),
         (0, 1, -inf, -8), (0, 1, -1e-9, 1e-9), (0, 1, -4, 40), (0, 1, 1, 1.5), (5, 1, -inf, 5.5), (0, 1, 3, 5), (0, 1e-3, 1, 2)],
        [0, 1e-10, 0.3, 1, 1.25, 3, 5, -1, -8, -8.5, -100, 30, 30.0625, 30.5, 32, 300, 300.0000005, 1e3, 1e10],
    ),
    "inv_gamma": (
        inv_gamma,
        [(1e-3, 1), (0.5, 2), (1, 1), (2, 1e-6), (3.7, 12), (63, 1), (64, 0.5), (1e6, 1e6), (1e9, 1e3)],
        [0, 1e-300, 1e-9, 1e-6, 0.008, 0.1, 1, 1.001, 3.3, 60, 1e6, 1e300, -1],
    ),
    "cauchy": (cauchy, [(0, 1), (-2, 0.1), (5, 1e3)], [0, 0.5, 5, -1e4, 1e200, -2, -2.5]),
    "laplace": (laplace, [(0, 1), (-2, 0.1), (5, 1e3)], [0, 0.5, 5, -1e4, 1e100, -2, -2.5]),
    "von_mises": (
        von_mises,
        [(0, 0), (0, 1e-10), (1, 0.5), (-2, 4), (0.5, 29.9), (0.5, 30.1), (3, 700), (0, 1e4), (0, 1e8)],
        [0, 1, -1.5, 3, 0.5, 1e-4, 0.49, 3.141592653589793, -3.141592653589793, 3.2, 1e5],
    ),
    "weibull": (weibull, [(0.1, 1), (0.5, 2), (1, 1), (2, 1e-6), (3.7, 12), (100, 5)], [0, 1e-300, 1e-7, 1e-6, 0.1, 1, 3.3, 5.01, 15, 1e6, -1]),
    "neg_binomial": (
        neg_binomial,
        [(1, 1), (1, 0.5), (3, 0.2), (0.5, 0.9), (1e-10, 0.3), (1e-20, 0.3), (2.7, 1e-6), (1e6, 0.5), (1e9, 0.999), (1e12, 0.1)],
        [0, 1, 2, 7, 2.5, -1, 1000, 1e6, 1001000, 999000, 1e9, 9e12],
    ),
    "geometric": (geometric, [(1,), (0.3,), (1e-10,), (0.999,)], [0, 1, 2, 50, 1e6, 1e12, 2.5, -1]),
    "poisson": (poisson, [(0,), (1e-10,), (0.5,), (9.99,), (1e3,), (1e9,)], [0, 1, 2, 10, 950, 1000, 1e9, 1000100000, 1e15, 2.5, -1]),
}


def dirichlet(x, *alpha):
    terms = [power(a - 1, x) for x, a in zip(x, alpha)]
    if -inf in terms:
        return -inf
    return loggamma(sum(alpha)) - sum(map(loggamma, alpha)) + sum(terms)


def categorical(k, *weights):
    return log(weights[int(k)] / sum(weights)) if k in range(len(weights)) and weights[int(k)] > 0 else -inf


def multinomial(x, n, *weights):
    if sum(x) != n or any(k < 0 or k != int(k) for k in x):
        return -inf
    terms = [power(k, w / sum(weights)) - loggamma(k + 1) for k, w in zip(x, weights)]
    return -inf if -inf in terms else loggamma(n + 1) + sum(terms)


def rows(xs):
    n = int(len(xs) ** 0.5)
    return n, [xs[i * n : i * n + n] for i in range(n)]


def lkj(x, n, eta):
    """Each row's numbers below the diagonal: (1 - r^2)^b over the unit ball, with b = eta - 1 + (n - 1 - i) / 2."""
    from mpmath import gamma

    n, l = rows(x)
    total = mpf(0)
    for i in range(1, n):
        b = eta - 1 + mpf(n - 1 - i) / 2
        ball = log(pi) * i / 2 + loggamma(b + 1) - loggamma(b + 1 + mpf(i) / 2)
        total += power(2 * b, l[i][i]) - ball
    return total


def wishart(x, df, *scale):
    """The density of W = L L' by its own lower triangle, times |dW/dL| = 2^n prod L[i][i]^(n - i)."""
    from mpmath import matrix

    n, l = rows(x)
    _, s = rows(scale)
    l, s = matrix(l), matrix(s)
    w, v = l * l.T, s * s.T
    trace = sum((v**-1 * w)[i, i] for i in range(n))
    logdet = lambda m: 2 * sum(log(m[i, i]) for i in range(n))
    gammas = log(pi) * n * (n - 1) / 4 + sum(loggamma((df - i) / 2) for i in range(n))
    density = (df - n - 1) / 2 * logdet(l) - trace / 2 - df * n / 2 * log(2) - df / 2 * logdet(s) - gammas
    return density + n * log(2) + sum((n - i) * log(l[i, i]) for i in range(n))


# Rows of length 1 in doubles: 0.6 and 0.8 are, to rounding; the others are sums of negative powers of 2.
LKJ3 = [(1, 0, 0, 0.6, 0.8, 0, 0.5, -0.5, 0.5**0.5), (1, 0, 0, 0, 1, 0, 0, 0, 1), (1, 0, 0, -0.8, 0.6, 0, 0.75, 0.66143782776, 1e-4)]
W3 = [(1, 0, 0, 0.5, 2, 0, -1, 0.25, 3), (1e-3, 0, 0, 10, 5, 0, 0, 0, 1e-5), (100, 0, 0, 0, 100, 0, 0, 0, 100)]

MORE = {
    "multinomial": (
        multinomial,
        [(10, 1, 2, 3), (0, 1, 1, 1), (10, 1, 0, 1e-300), (1000000, 0.3, 0.3, 0.4), (10**12, 1, 1e6, 1e6)],
        [(1, 3, 6), (10, 0, 0), (5, 0, 5), (0, 0, 0), (300000, 300000, 400000), (1000000, 0, 0), (10**6, 5 * 10**11, 5 * 10**11 - 10**6),
         (2.5, 2.5, 5), (-1, 5, 6)],
    ),
    "lkj": (lkj, [(3, 1), (3, 0.5), (3, 2.5), (3, 1e6)], LKJ3),
    "wishart": (wishart, [(2.5, 1, 0, 0, 0, 1, 0, 0, 0, 1), (7, 1, 0, 0, -1, 0.5, 0, 3, 2, 4), (1e4, 1, 0, 0, 0, 1, 0, 0, 0, 1)], W3),
    "categorical": (categorical, [(1, 2, 3, 4), (0, 1e-300, 1, 0)], [0, 1, 2, 3, 4, 1.5, -1]),
    "dirichlet": (
        dirichlet,
        [(1, 1, 1), (0.5, 2, 3.5), (1e-3, 1e-3, 1e-3), (100, 2000, 30)],
        [(0.25, 0.25, 0.5), (0.0625, 0.9375, 0), (1, 0, 0), (0.5, 0.5, 0.5), (2**-30, 1 - 2**-29, 2**-30)],
    ),
}


def special():
    from mpmath import besseli, digamma, erfc, exp

    def mills_ratio(x):
        return sqrt(pi / 2) * erfc(x / sqrt(2)) * exp(x * x / 2)

    def log_normal_cdf(x):
        return log(erfc(-x / sqrt(2)) / 2)

    def stirling_error(x):
        return loggamma(x) - ((x - mpf(1) / 2) * log(x) - x + log(2 * pi) / 2)

    def deviance(x, m):
        return x * log(x / m) + m - x

    yield from ((n, f, a) for n, f, all_ in [
        ("log_normal_cdf", log_normal_cdf, [(0,), (-1,), (3,), (6,), (-10,), (-36.9,), (-37.1,), (-40,), (-1e5,)]),
        ("mills_ratio", mills_ratio, [(0,), (0.5,), (3.99,), (4,), (4.01,), (10,), (37,), (1e4,), (1e100,)]),
        ("log_scaled_i0", lambda x: log(besseli(0, x)) - x, [(0,), (1e-9,), (0.5,), (5,), (29.9,), (30,), (100,), (1e4,)]),
        ("bessel_deficit", lambda x: 1 - besseli(1, x) / besseli(0, x), [(0,), (1e-9,), (0.5,), (5,), (29.9,), (30,), (100,), (1e4,)]),
        ("digamma", digamma, [(1e-5,), (0.1,), (0.5,), (1,), (1.46,), (1.5,), (7.9,), (8.1,), (25.5,), (1e8,), (-0.5,), (-7.3,)]),
        ("ln_beta", lnbeta, [(1e-3, 1e9), (0.01, 0.01), (0.5, 5e14), (9.9, 9.9), (9.9, 10.1), (12, 15), (1e6, 2e6), (1e-10, 1e10), (3, 1e7)]),
        ("ln_choose", lambda n, k: -log(n + 1) - lnbeta(k + 1, n - k + 1), [(20, 14), (1e9, 3), (1e6, 5e5)]),
        ("stirling_error", stirling_error, [(0.1,), (1,), (9.9,), (10,), (15.5,), (1e3,), (1e12,)]),
        ("deviance", deviance, [(1, 1.0001), (5, 6), (5, 7), (1e9, 1000100000), (3, 1e-300), (1e15, 1000000000000001)]),
    ] for a in all_)


def value(x):
    return nstr(x, 25, strip_zeros=False) if abs(x) != inf else ("inf" if x > 0 else "-inf")


if __name__ == "__main__":
    print("family,parameters,point,log_density")
    for name, (f, parameters, points) in FAMILIES.items():
        for ps in parameters:
            for x in points:
                y = f(mpf(float(x)), *(mpf(float(p)) for p in ps))
                print(f"{name},{' '.join(repr(float(p)) for p in ps)},{float(x)!r},{value(y)}")
    for name, (f, parameters, points) in MORE.items():
        for ps in parameters:
            for x in points:
                exact = tuple(mpf(float(x)) for x in x) if isinstance(x, tuple) else mpf(float(x))
                y = -inf if name == "dirichlet" and sum(x) != 1 else f(exact, *(mpf(float(p)) for p in ps))
                shown = " ".join(repr(float(x)) for x in (x if isinstance(x, tuple) else (x,)))
                print(f"{name},{' '.join(repr(float(p)) for p in ps)},{shown},{value(y)}")
    for name, f, args in special():
        print(f"num:{name},{' '.join(repr(float(a)) for a in args)},,{value(f(*(mpf(float(a)) for a in args)))}")
