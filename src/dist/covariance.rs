//! Covariance functions of Gaussian processes (Rasmussen and Williams 2006, chapter 4).

use super::ParamError;
use super::param::positive;
use nalgebra::DMatrix;
use std::fmt;
use std::ops::{Add, Mul};

/// A covariance function k(x, y) of numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Covariance {
    /// sd^2 exp(-(x - y)^2 / (2 length^2))
    SqExp {
        /// The length over which values stay alike.
        length: f64,
        /// The standard deviation.
        sd: f64,
    },
    /// Matérn with nu = 3/2.
    Matern32 {
        /// As above.
        length: f64,
        /// As above.
        sd: f64,
    },
    /// Matérn with nu = 5/2.
    Matern52 {
        /// As above.
        length: f64,
        /// As above.
        sd: f64,
    },
    /// sd^2 exp(-2 sin^2(pi (x - y) / period) / length^2)
    Periodic {
        /// The period.
        period: f64,
        /// The length of likeness, as a fraction of a period.
        length: f64,
        /// The standard deviation.
        sd: f64,
    },
    /// sd^2 where x and y are the same point.
    White {
        /// The standard deviation.
        sd: f64,
    },
    /// The sum of two.
    Sum(Box<Covariance>, Box<Covariance>),
    /// The product of two.
    Product(Box<Covariance>, Box<Covariance>),
}

impl Covariance {
    /// Squared exponential.
    ///
    /// # Errors
    /// Unless both parameters are positive and finite.
    pub fn sq_exp(length: f64, sd: f64) -> Result<Self, ParamError> {
        Ok(Covariance::SqExp { length: positive("sq_exp", "length", length)?, sd: positive("sq_exp", "sd", sd)? })
    }

    /// Matérn 3/2.
    ///
    /// # Errors
    /// As [`Covariance::sq_exp`].
    pub fn matern32(length: f64, sd: f64) -> Result<Self, ParamError> {
        Ok(Covariance::Matern32 {
            length: positive("matern32", "length", length)?,
            sd: positive("matern32", "sd", sd)?,
        })
    }

    /// Matérn 5/2.
    ///
    /// # Errors
    /// As [`Covariance::sq_exp`].
    pub fn matern52(length: f64, sd: f64) -> Result<Self, ParamError> {
        Ok(Covariance::Matern52 {
            length: positive("matern52", "length", length)?,
            sd: positive("matern52", "sd", sd)?,
        })
    }

    /// Periodic.
    ///
    /// # Errors
    /// As [`Covariance::sq_exp`].
    pub fn periodic(period: f64, length: f64, sd: f64) -> Result<Self, ParamError> {
        Ok(Covariance::Periodic {
            period: positive("periodic", "period", period)?,
            length: positive("periodic", "length", length)?,
            sd: positive("periodic", "sd", sd)?,
        })
    }

    /// White noise.
    ///
    /// # Errors
    /// As [`Covariance::sq_exp`].
    pub fn white(sd: f64) -> Result<Self, ParamError> {
        Ok(Covariance::White { sd: positive("white", "sd", sd)? })
    }

    /// The covariance of the values at two points; `same` tells whether they are one point of the list.
    pub fn at(&self, x: f64, y: f64, same: bool) -> f64 {
        let r = (x - y).abs();
        match self {
            Covariance::SqExp { length, sd } => {
                let z = r / length;
                sd * sd * libm::exp(-0.5 * z * z)
            }
            Covariance::Matern32 { length, sd } => {
                let z = 3f64.sqrt() * r / length;
                sd * sd * (1.0 + z) * libm::exp(-z)
            }
            Covariance::Matern52 { length, sd } => {
                let z = 5f64.sqrt() * r / length;
                sd * sd * (1.0 + z + z * z / 3.0) * libm::exp(-z)
            }
            Covariance::Periodic { period, length, sd } => {
                let s = libm::sin(core::f64::consts::PI * r / period) / length;
                sd * sd * libm::exp(-2.0 * s * s)
            }
            Covariance::White { sd } => {
                if same {
                    sd * sd
                } else {
                    0.0
                }
            }
            Covariance::Sum(a, b) => a.at(x, y, same) + b.at(x, y, same),
            Covariance::Product(a, b) => a.at(x, y, same) * b.at(x, y, same),
        }
    }

    /// The variance at a point: the same everywhere.
    pub fn variance(&self) -> f64 {
        self.at(0.0, 0.0, true)
    }

    /// The covariance matrix of some points.
    pub fn matrix(&self, points: &[f64]) -> DMatrix<f64> {
        let n = points.len();
        let mut m = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let k = self.at(points[i], points[j], i == j);
                m[(i, j)] = k;
                m[(j, i)] = k;
            }
        }
        m
    }
}

impl Add for Covariance {
    type Output = Covariance;

    fn add(self, other: Covariance) -> Covariance {
        Covariance::Sum(Box::new(self), Box::new(other))
    }
}

impl Mul for Covariance {
    type Output = Covariance;

    fn mul(self, other: Covariance) -> Covariance {
        Covariance::Product(Box::new(self), Box::new(other))
    }
}

impl fmt::Display for Covariance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Covariance::SqExp { length, sd } => write!(f, "sq_exp({length}, {sd})"),
            Covariance::Matern32 { length, sd } => write!(f, "matern32({length}, {sd})"),
            Covariance::Matern52 { length, sd } => write!(f, "matern52({length}, {sd})"),
            Covariance::Periodic { period, length, sd } => write!(f, "periodic({period}, {length}, {sd})"),
            Covariance::White { sd } => write!(f, "white({sd})"),
            Covariance::Sum(a, b) => write!(f, "{a} + {b}"),
            Covariance::Product(a, b) => write!(f, "({a}) * ({b})"),
        }
    }
}
