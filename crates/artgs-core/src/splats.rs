//! 3D Gaussians in the parameters of the optimiser.

/// A set of 3D Gaussians in raw (pre-activation) parameters, structure of arrays, `n` each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Centres, scene units.
    pub means: Vec<[f32; 3]>,
    /// Quaternions (w, x, y, z), not normalised.
    pub rotations: Vec<[f32; 4]>,
    /// Natural logarithms of the standard deviations along the local axes.
    pub log_scales: Vec<[f32; 3]>,
    /// Opacities before the sigmoid.
    pub logit_opacities: Vec<f32>,
    /// Degree of the stored spherical harmonics, 0 to 3.
    pub sh_degree: usize,
    /// Spherical harmonics, `[n][(sh_degree + 1)^2][3]`; colour is `max(0, 0.5 + sum)`.
    pub sh: Vec<f32>,
}

impl Splats {
    /// An empty set with harmonics of the given degree.
    pub fn empty(sh_degree: usize) -> Self {
        Self { sh_degree, ..Self::default() }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Floats of harmonics per Gaussian: `3 (sh_degree + 1)^2`.
    pub fn sh_stride(&self) -> usize {
        3 * (self.sh_degree + 1) * (self.sh_degree + 1)
    }

    /// Appends copies of the Gaussians `indices` of `other`, which must store the same degree.
    pub fn extend_from(&mut self, other: &Self, indices: impl IntoIterator<Item = usize>) {
        assert_eq!(self.sh_degree, other.sh_degree, "sets have different degrees");
        let stride = self.sh_stride();
        for i in indices {
            self.means.push(other.means[i]);
            self.rotations.push(other.rotations[i]);
            self.log_scales.push(other.log_scales[i]);
            self.logit_opacities.push(other.logit_opacities[i]);
            self.sh.extend_from_slice(&other.sh[i * stride..(i + 1) * stride]);
        }
    }

    /// The Gaussians `indices`, in that order.
    pub fn select(&self, indices: impl IntoIterator<Item = usize>) -> Self {
        let mut out = Self::empty(self.sh_degree);
        out.extend_from(self, indices);
        out
    }
}
