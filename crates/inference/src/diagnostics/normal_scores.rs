//! Rank normalisation: replaces draws by the normal quantiles of their ranks, which makes
//! the diagnostics valid for heavy tails (Vehtari et al. 2021, equation 14).

use super::chains::Chains;

/// The normal score z = Φ⁻¹((r - 3/8) / (S + 1/4)) of each draw, with r its rank among
/// all S draws; ties share their mean rank.
pub(super) fn normal_scores(chains: &Chains) -> Chains {
    let x = chains.values();
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|&a, &b| x[a].total_cmp(&x[b]));
    let mut z = vec![0.0; x.len()];
    let mut first = 0;
    for tie in order.chunk_by(|&a, &b| x[a] == x[b]) {
        let rank = first as f64 + (tie.len() as f64 + 1.0) / 2.0;
        let score = normal_quantile((rank - 0.375) / (x.len() as f64 + 0.25));
        tie.iter().for_each(|&i| z[i] = score);
        first += tie.len();
    }
    chains.with_values(z)
}

/// The quantile of the standard normal distribution, 0 < p < 1, to a relative error of
/// about 1e-16: Wichura, "Algorithm AS 241: the percentage points of the normal
/// distribution" (Applied Statistics 37:3, 1988), routine PPND16.
fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180625 - q * q;
        return q * ratio(&CENTRAL, r);
    }
    let tail = if q < 0.0 { p } else { 1.0 - p };
    let r = libm::sqrt(-libm::log(tail));
    let x = if r <= 5.0 { ratio(&MIDDLE, r - 1.6) } else { ratio(&FAR, r - 5.0) };
    if q < 0.0 { -x } else { x }
}

/// A rational function, with the coefficients of numerator and denominator from the
/// highest power down.
fn ratio([num, den]: &[[f64; 8]; 2], r: f64) -> f64 {
    let horner = |c: &[f64; 8]| c.iter().fold(0.0, |acc, c| acc * r + c);
    horner(num) / horner(den)
}

const CENTRAL: [[f64; 8]; 2] = [
    [
        2.509_080_928_730_122_672_7e3,
        3.343_057_558_358_812_810_5e4,
        6.726_577_092_700_870_085_3e4,
        4.592_195_393_154_987_145_7e4,
        1.373_169_376_550_946_112_5e4,
        1.971_590_950_306_551_442_7e3,
        1.331_416_678_917_843_774_5e2,
        3.387_132_872_796_366_608,
    ],
    [
        5.226_495_278_852_854_561e3,
        2.872_908_573_572_194_267_4e4,
        3.930_789_580_009_271_061e4,
        2.121_379_430_158_659_586_7e4,
        5.394_196_021_424_751_107_7e3,
        6.871_870_074_920_579_083e2,
        4.231_333_070_160_091_125_2e1,
        1.0,
    ],
];
const MIDDLE: [[f64; 8]; 2] = [
    [
        7.745_450_142_783_414_076_4e-4,
        2.272_384_498_926_918_458_6e-2,
        2.417_807_251_774_506_117_7e-1,
        1.270_458_252_452_368_382_6,
        3.647_848_324_763_204_605_1,
        5.769_497_221_460_691_405_5,
        4.630_337_846_156_545_295_9,
        1.423_437_110_749_683_577_3,
    ],
    [
        1.050_750_071_644_416_843_2e-9,
        5.475_938_084_995_344_946e-4,
        1.519_866_656_361_645_719_7e-2,
        1.481_039_764_274_800_745_9e-1,
        6.897_673_349_851_000_045_5e-1,
        1.676_384_830_183_803_849_4,
        2.053_191_626_637_758_821_9,
        1.0,
    ],
];
const FAR: [[f64; 8]; 2] = [
    [
        2.010_334_399_292_288_132_7e-7,
        2.711_555_568_743_487_578_2e-5,
        1.242_660_947_388_078_438_6e-3,
        2.653_218_952_657_612_309_3e-2,
        2.965_605_718_285_048_912_3e-1,
        1.784_826_539_917_291_335_8,
        5.463_784_911_164_114_369_9,
        6.657_904_643_501_103_777_2,
    ],
    [
        2.044_263_103_389_939_785_6e-15,
        1.421_511_758_316_445_888_7e-7,
        1.846_318_317_510_054_681_8e-5,
        7.868_691_311_456_132_591e-4,
        1.487_536_129_085_061_485e-2,
        1.369_298_809_227_358_053_4e-1,
        5.998_322_065_558_879_376_9e-1,
        1.0,
    ],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_invert_the_distribution_function() {
        // From tail to tail through all three branches: p = erfc(-x / √2) / 2.
        for i in -800..=800 {
            let x = f64::from(i) / 100.0;
            let p = libm::erfc(-x / std::f64::consts::SQRT_2) / 2.0;
            // Near p = 1 the spacing of doubles limits the accuracy of the inverse.
            let spacing = f64::EPSILON * p / (libm::exp(-x * x / 2.0) / 2.506_628_274_631_000_7);
            assert!(
                (normal_quantile(p) - x).abs() <= 1e-13 + 4.0 * spacing,
                "{x}: {}",
                normal_quantile(p)
            );
        }
        assert_eq!(normal_quantile(0.5), 0.0);
    }

    #[test]
    fn ties_share_their_mean_rank() {
        let c = Chains::new(&[[3.0, 1.0, 2.0, 2.0]]).unwrap();
        let z = normal_scores(&c);
        assert_eq!(z.values()[2], 0.0);
        assert_eq!(z.values()[2], z.values()[3]);
        assert_eq!(z.values()[0], -z.values()[1]);
        assert!((z.values()[0] - normal_quantile(3.625 / 4.25)).abs() < 1e-15);
    }

    #[test]
    fn negative_zero_ties_with_zero() {
        let z = normal_scores(&Chains::new(&[[0.0, -0.0, 1.0, -1.0]]).unwrap());
        assert_eq!(z.values()[0], z.values()[1]);
    }
}
