//! The vectors the kernels are written in: 16 lanes of f32, instruction set chosen at run time.

use fearless_simd::{f32x16, mask32x16, u32x16};
use std::sync::atomic::{AtomicU8, Ordering};

pub use fearless_simd::Level;

pub(crate) use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, dispatch};

/// 16 floats.
pub(crate) type Lanes<S> = f32x16<S>;
/// 16 booleans.
pub(crate) type Mask<S> = mask32x16<S>;

/// Lanes of a vector.
pub(crate) const WIDTH: usize = 16;

/// An instruction set that kernels exist for. Other machines have one only: NEON on ARM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The best this machine has.
    #[default]
    Best,
    /// 512-bit vectors of x86-64 (Ice Lake, Zen 4 and later).
    Avx512,
    /// 256-bit vectors and fused multiply-add of x86-64 (Haswell, Zen and later).
    Avx2,
    /// 128-bit vectors of x86-64.
    Sse42,
    /// Scalar code, to test the others against; only with the feature `scalar`.
    Scalar,
}

impl Instructions {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Best, Self::Avx512, Self::Avx2, Self::Sse42, Self::Scalar];

    /// The token that proves that this machine has them.
    fn level(self) -> Option<Level> {
        let best = Level::new();
        match self {
            Self::Best => Some(best),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Avx512 => best.as_avx512().map(Level::Avx512),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Avx2 => best.as_avx2().map(Level::Avx2),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Sse42 => best.as_sse4_2().map(Level::Sse4_2),
            #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
            Self::Avx512 | Self::Avx2 | Self::Sse42 => None,
            #[cfg(feature = "scalar")]
            Self::Scalar => Some(Level::fallback()),
            #[cfg(not(feature = "scalar"))]
            Self::Scalar => None,
        }
    }
}

/// The last argument of [`use_instructions`], as its position in [`Instructions::ALL`].
static CHOSEN: AtomicU8 = AtomicU8::new(0);

/// Makes every kernel of the process use these instructions from now on: to compare them in tests and benchmarks.
/// False, and nothing changes, if this machine or build does not have them.
pub fn use_instructions(instructions: Instructions) -> bool {
    let available = instructions.level().is_some();
    if available {
        CHOSEN.store(instructions as u8, Ordering::Relaxed);
    }
    available
}

/// The instruction set in use: the best of this machine (detected once) unless [`use_instructions`] chose another.
#[inline]
pub fn level() -> Level {
    let chosen = Instructions::ALL[usize::from(CHOSEN.load(Ordering::Relaxed))];
    if chosen == Instructions::Best { Level::new() } else { chosen.level().unwrap_or_else(Level::new) }
}

/// Name of the instruction set in use.
pub fn instructions() -> &'static str {
    let level = level();
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    let names = [
        (level.as_avx512().is_some(), "AVX-512"),
        (level.as_avx2().is_some(), "AVX2"),
        (level.as_sse4_2().is_some(), "SSE4.2"),
    ];
    #[cfg(target_arch = "aarch64")]
    let names = [(level.as_neon().is_some(), "NEON")];
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
    let names = [(level.is_fallback(), "scalar code")];
    names.iter().find(|(has, _)| *has).map_or("scalar code", |(_, name)| name)
}

/// `2^x` for x in [-126, 126], relative error 2.1e-7; undefined outside.
/// Adding 1.5 * 2^23 rounds to an integer, whose bits then move into the exponent.
#[inline(always)]
pub(crate) fn exp2<S: Simd>(s: S, x: Lanes<S>) -> Lanes<S> {
    let shifted = x + Lanes::splat(s, 12_582_912.0);
    let f = x - (shifted - Lanes::splat(s, 12_582_912.0));
    let mut p = f.mul_add(Lanes::splat(s, 0.001_327_647_2), Lanes::splat(s, 0.009_675_541));
    p = f.mul_add(p, Lanes::splat(s, 0.055_507_13));
    p = f.mul_add(p, Lanes::splat(s, 0.240_221_2));
    p = f.mul_add(p, Lanes::splat(s, 0.693_146_94));
    p = f.mul_add(p, Lanes::splat(s, 1.000_000_1));
    let exponent: u32x16<S> = shifted.to_bits();
    Lanes::from_bits(p.to_bits() + (exponent << 23))
}

/// Lane of the result of [`sums`] that holds the sum of vector `k`: the four bits of `k` reversed.
pub(crate) const fn sum_lane(k: usize) -> usize {
    ((k as u8).reverse_bits() >> 4) as usize
}

/// Sums over the lanes of ten vectors at once; see [`sum_lane`] for the lane of each sum.
#[inline(always)]
pub(crate) fn sums<S: Simd>(v: &[Lanes<S>; 10]) -> Lanes<S> {
    // Each fold halves the number of partial sums per vector and interleaves two vectors.
    let a = fold(fold(v[0], v[1]), fold(v[2], v[3]));
    let b = fold(fold(v[4], v[5]), fold(v[6], v[7]));
    let c = fold(v[8], v[9]);
    let c = fold(c, c);
    fold(fold(a, b), fold(c, c))
}

/// Lane `2 i` of the result is `a[i] + a[i + 8]`, lane `2 i + 1` the same of `b`.
#[inline(always)]
fn fold<S: Simd>(a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    a.zip_low(b) + a.zip_high(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp2_is_accurate_in_the_range_of_alpha() {
        dispatch!(level(), s => {
            for i in 0..8200 {
                let x = -i as f32 / 1000.0;
                let got = exp2(s, Lanes::splat(s, x)).as_slice()[7];
                assert!((got / x.exp2() - 1.0).abs() < 4e-7, "2^{x} = {got}");
            }
        });
    }

    #[test]
    fn sums_land_in_their_lanes() {
        dispatch!(level(), s => {
            let mut v = [Lanes::splat(s, 0.0); 10];
            for k in 0..10 {
                v[k] = Lanes::from_slice(s, &std::array::from_fn::<f32, WIDTH, _>(|i| ((k * 31 + i * 7) % 13) as f32));
            }
            let total = sums(&v);
            for k in 0..10 {
                assert_eq!(total.as_slice()[sum_lane(k)], v[k].as_slice().iter().sum::<f32>());
            }
        });
    }
}
