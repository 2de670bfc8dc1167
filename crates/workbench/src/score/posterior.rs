//! Errors of posterior moments with respect to a reference.

use indexmap::IndexMap;

/// A mean and a standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub sd: f64,
}

/// Known moments of a posterior, by quantity.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reference {
    /// The means and standard deviations of the quantities.
    pub quantities: IndexMap<String, Normal>,
}

impl Reference {
    /// The error for a quantity without an answer: that of a point mass two standard
    /// deviations from the mean.
    pub const UNKNOWN: f64 = 2.236_067_977_499_79;

    /// Returns the root mean square, over the quantities, of the 2-Wasserstein distance
    /// between normals with the two means and standard deviations (Givens and Shortt
    /// 1984), in standard deviations of the reference: 0 if both agree, 1 for a point
    /// mass at the right mean.
    pub fn error(&self, found: &IndexMap<String, Normal>) -> f64 {
        let one = |(name, truth): (&String, &Normal)| {
            let found = found.get(name)?;
            let (mean, sd) =
                ((found.mean - truth.mean) / truth.sd, (found.sd - truth.sd) / truth.sd);
            let squared = mean * mean + sd * sd;
            squared.is_finite().then_some(squared)
        };
        let unknown = Self::UNKNOWN * Self::UNKNOWN;
        let sum: f64 = self.quantities.iter().map(|q| one(q).unwrap_or(unknown)).sum();
        (sum / self.quantities.len().max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_by_hand() {
        let all = |list: &[(&str, f64, f64)]| -> IndexMap<String, Normal> {
            list.iter()
                .map(|(n, mean, sd)| ((*n).to_owned(), Normal { mean: *mean, sd: *sd }))
                .collect()
        };
        let reference = Reference { quantities: all(&[("a", 1.0, 2.0), ("b", 0.0, 1.0)]) };
        assert_eq!(reference.error(&reference.quantities), 0.0);
        // a: the mean is off by one sd, and the sd is half; b: a point mass.
        let e = reference.error(&all(&[("a", 3.0, 1.0), ("b", 0.0, 0.0)]));
        assert!((e - ((1.25 + 1.0) / 2.0f64).sqrt()).abs() < 1e-12);
        assert!((reference.error(&IndexMap::new()) - Reference::UNKNOWN).abs() < 1e-12);
        assert!(reference.error(&all(&[("a", f64::NAN, 1.0), ("b", 0.0, 1.0)])).is_finite());
    }
}
