//! LPIPS (Zhang et al., "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric", 2018, version 0.1): a
//! weighted distance of the features that AlexNet or VGG16 see in two pictures. The user brings the weights.
//!
//! Tensors needed, as torchvision and the `lpips` package name them, all F32:
//! * `features.N.weight` `[out, in, k, k]` and `features.N.bias` `[out]`; for AlexNet N is 0, 3, 6, 8, 10, for VGG16
//!   0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28;
//! * `lin0.model.1.weight` to `lin4.model.1.weight` `[1, channels, 1, 1]`.

use super::convolution::{Convolution, Features, max_pool};
use artgs_io::{FileError, Tensor, read_safetensors};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Shift and scale of the colours in [-1, 1] that the networks expect.
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Keeps features without length from dividing by zero.
const EPSILON: f32 = 1e-10;

/// Weights that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LpipsError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A tensor is missing or of another shape.
    #[error("{}: tensor `{tensor}` {reason}; see docs/lpips.md for how to make the file", path.display())]
    Tensor {
        /// The weights.
        path: PathBuf,
        /// Its name.
        tensor: String,
        /// What is wrong.
        reason: String,
    },
}

/// Which network the features come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LpipsNet {
    /// AlexNet, what the authors recommend for comparing pictures.
    Alex,
    /// VGG16, what papers on novel views report.
    Vgg,
}

/// A layer of a network in the order of evaluation; every convolution is followed by `max(0, x)`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Layer {
    /// Index in `features`, shape `[out, in, kernel]`, stride and padding.
    Convolve { index: usize, shape: [usize; 3], stride: usize, padding: usize },
    /// Largest of a window of `size` every 2 pixels.
    Pool { size: usize },
    /// Features are compared here.
    Compare,
}

impl LpipsNet {
    fn layers(self) -> Vec<Layer> {
        let convolve = |index, shape, stride, padding| Layer::Convolve { index, shape, stride, padding };
        match self {
            Self::Alex => vec![
                convolve(0, [64, 3, 11], 4, 2),
                Layer::Compare,
                Layer::Pool { size: 3 },
                convolve(3, [192, 64, 5], 1, 2),
                Layer::Compare,
                Layer::Pool { size: 3 },
                convolve(6, [384, 192, 3], 1, 1),
                Layer::Compare,
                convolve(8, [256, 384, 3], 1, 1),
                Layer::Compare,
                convolve(10, [256, 256, 3], 1, 1),
                Layer::Compare,
            ],
            Self::Vgg => {
                let (mut out, mut index, mut before) = (Vec::new(), 0, 3);
                for (channels, count) in [(64, 2), (128, 2), (256, 3), (512, 3), (512, 3)] {
                    if index > 0 {
                        out.push(Layer::Pool { size: 2 });
                        index += 1;
                    }
                    for _ in 0..count {
                        out.push(convolve(index, [channels, before, 3], 1, 1));
                        (index, before) = (index + 2, channels);
                    }
                    out.push(Layer::Compare);
                }
                out
            }
        }
    }
}

/// A layer with its weights.
#[derive(Clone, Debug)]
enum Step {
    Convolve(Convolution),
    Pool(usize),
    /// Weight of every channel.
    Compare(Vec<f32>),
}

/// A network with weights, ready to compare pictures.
#[derive(Clone, Debug)]
pub struct Lpips {
    net: LpipsNet,
    steps: Vec<Step>,
}

impl Lpips {
    /// Reads weights; the shape of `features.0.weight` identifies the network. Tensors that are not needed are
    /// ignored.
    pub fn load(path: &Path) -> Result<Self, LpipsError> {
        let mut tensors = read_safetensors(path)?;
        let refuse = |(tensor, reason)| LpipsError::Tensor { path: path.into(), tensor, reason };
        Self::from_tensors(&mut tensors).map_err(refuse)
    }

    /// Takes the tensors out of a map; an error is the name of a tensor and what is wrong with it.
    fn from_tensors(tensors: &mut BTreeMap<String, Tensor>) -> Result<Self, (String, String)> {
        let first = "features.0.weight";
        let shape = tensors.get(first).map(|t| t.shape.clone()).ok_or((first.into(), "is missing".to_string()))?;
        let net = match shape[..] {
            [64, 3, 11, 11] => LpipsNet::Alex,
            [64, 3, 3, 3] => LpipsNet::Vgg,
            _ => {
                let reason = format!("is {shape:?}; AlexNet has [64, 3, 11, 11], VGG16 [64, 3, 3, 3]");
                return Err((first.into(), reason));
            }
        };
        let mut take = |name: String, shape: &[usize]| match tensors.remove(&name) {
            None => Err((name, "is missing".to_string())),
            Some(t) if t.shape != shape => Err((name, format!("is {:?}, expected {shape:?}", t.shape))),
            Some(t) if t.values.iter().any(|v| !v.is_finite()) => {
                Err((name, "has a number that is not finite".to_string()))
            }
            Some(t) => Ok(t.values),
        };
        let (mut steps, mut compared, mut channels) = (Vec::new(), 0, 3);
        for layer in net.layers() {
            steps.push(match layer {
                Layer::Convolve { index, shape: [outputs, inputs, kernel], stride, padding } => {
                    let weights = take(format!("features.{index}.weight"), &[outputs, inputs, kernel, kernel])?;
                    let bias = take(format!("features.{index}.bias"), &[outputs])?;
                    channels = outputs;
                    Step::Convolve(Convolution { inputs, kernel, stride, padding, weights, bias })
                }
                Layer::Pool { size } => Step::Pool(size),
                Layer::Compare => {
                    compared += 1;
                    let name = format!("lin{}.model.1.weight", compared - 1);
                    Step::Compare(take(name, &[1, channels, 1, 1])?)
                }
            });
        }
        Ok(Self { net, steps })
    }

    /// Which network it is.
    pub fn net(&self) -> LpipsNet {
        self.net
    }

    /// Distance of two planar sRGB pictures `[3][height * width]` in [0, 1], at least 0; none if they are too small for
    /// the network (AlexNet needs 31 pixels, VGG16 16).
    pub fn distance(&self, a: &[f32], b: &[f32], width: usize, height: usize) -> Option<f64> {
        assert!(a.len() == 3 * width * height && b.len() == a.len());
        let mut pair = [a, b].map(|rgb| scaled(rgb, width, height));
        let mut sum = 0.0;
        for step in &self.steps {
            match step {
                Step::Compare(weights) => sum += compare(&pair[0], &pair[1], weights),
                Step::Convolve(convolution) => pair = advance(&pair, |f| convolution.rectified(f))?,
                Step::Pool(size) => pair = advance(&pair, |f| max_pool(f, *size, 2))?,
            }
        }
        Some(sum)
    }
}

fn advance(pair: &[Features; 2], step: impl Fn(&Features) -> Option<Features>) -> Option<[Features; 2]> {
    Some([step(&pair[0])?, step(&pair[1])?])
}

/// A picture as the first layer wants it.
fn scaled(rgb: &[f32], width: usize, height: usize) -> Features {
    let n = width * height;
    let value = |(i, v): (usize, &f32)| (2.0 * v - 1.0 - SHIFT[i / n]) / SCALE[i / n];
    Features { channels: 3, width, height, values: rgb.iter().enumerate().map(value).collect() }
}

/// `mean over pixels of sum over channels w (f/|f| - g/|g|)^2`.
fn compare(a: &Features, b: &Features, weights: &[f32]) -> f64 {
    let n = a.width * a.height;
    let lengths = [a, b].map(|f| {
        let mut squares = vec![0.0_f32; n];
        for channel in f.values.chunks(n) {
            squares.iter_mut().zip(channel).for_each(|(s, v)| *s += v * v);
        }
        squares.into_iter().map(|s| s.sqrt() + EPSILON).collect::<Vec<f32>>()
    });
    let mut sum = 0.0;
    for (c, weight) in weights.iter().enumerate() {
        let (x, y) = (&a.values[c * n..][..n], &b.values[c * n..][..n]);
        let square = |i: usize| f64::from(x[i] / lengths[0][i] - y[i] / lengths[1][i]).powi(2);
        sum += f64::from(*weight) * (0..n).map(square).sum::<f64>();
    }
    sum / n as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in `[-scale, scale)` that another program can make as well.
    fn fill(shape: &[usize], tag: usize, scale: f64, offset: f64) -> Tensor {
        let step = 0.618_033_988_749_894_9;
        let value =
            |i: usize| (((i + 1) as f64 * step * (tag + 1) as f64 * 1.3247179572).rem_euclid(1.0) - 0.5) * 2.0 * scale;
        let values = (0..shape.iter().product()).map(|i| value(i) as f32 + offset as f32).collect();
        Tensor { shape: shape.to_vec(), values }
    }

    fn weights(net: LpipsNet) -> BTreeMap<String, Tensor> {
        let (mut out, mut channels, mut compared) = (BTreeMap::new(), 3, 0);
        for layer in net.layers() {
            match layer {
                Layer::Convolve { index, shape: [outputs, inputs, kernel], .. } => {
                    let scale = (6.0 / (inputs * kernel * kernel) as f64).sqrt();
                    let weight = fill(&[outputs, inputs, kernel, kernel], index, scale, 0.0);
                    out.insert(format!("features.{index}.weight"), weight);
                    out.insert(format!("features.{index}.bias"), fill(&[outputs], 50 + index, 0.1, 0.0));
                    channels = outputs;
                }
                Layer::Compare => {
                    let weight = fill(&[1, channels, 1, 1], 100 + compared, 0.5, 0.5);
                    out.insert(format!("lin{compared}.model.1.weight"), weight);
                    compared += 1;
                }
                Layer::Pool { .. } => {}
            }
        }
        out
    }

    fn picture(width: usize, height: usize, phase: f64) -> Vec<f32> {
        let value = |c: usize, i: usize| {
            let (x, y) = ((i % width) as f64, (i / width) as f64);
            (0.5 + 0.5 * (0.37 * x * (c + 1) as f64 + 0.21 * y * (phase + 1.0) + phase).sin()) as f32
        };
        (0..3).flat_map(|c| (0..width * height).map(move |i| value(c, i))).collect()
    }

    /// The numbers are those of the authors' package (lpips 0.1.4 on torch) with the same made-up weights.
    #[test]
    fn agrees_with_the_published_program() {
        for (net, (width, height), expected) in
            [(LpipsNet::Alex, (70, 64), 1.263506), (LpipsNet::Vgg, (40, 33), 1.177108)]
        {
            let lpips = Lpips::from_tensors(&mut weights(net)).unwrap();
            assert_eq!(lpips.net(), net);
            let (a, b) = (picture(width, height, 0.0), picture(width, height, 1.0));
            let found = lpips.distance(&a, &b, width, height).unwrap();
            assert!((found - expected).abs() < 2e-5, "{net:?}: {found} against {expected}");
            assert_eq!(lpips.distance(&a, &a, width, height), Some(0.0));
            let smallest = if net == LpipsNet::Alex { 31 } else { 16 };
            let square = |n: usize| lpips.distance(&picture(n, n, 0.0), &picture(n, n, 1.0), n, n);
            assert!(square(smallest).is_some() && square(smallest - 1).is_none());
        }
    }

    #[test]
    fn tensors_that_do_not_fit_are_named() {
        let broken = |edit: &dyn Fn(&mut BTreeMap<String, Tensor>)| {
            let mut tensors = weights(LpipsNet::Alex);
            edit(&mut tensors);
            Lpips::from_tensors(&mut tensors).unwrap_err()
        };
        let missing = |name: &str| broken(&|t| drop(t.remove(name)));
        assert_eq!(missing("features.0.weight"), ("features.0.weight".into(), "is missing".into()));
        assert_eq!(missing("lin4.model.1.weight"), ("lin4.model.1.weight".into(), "is missing".into()));
        let reshape = |t: &mut BTreeMap<String, Tensor>| t.get_mut("features.3.bias").unwrap().shape = vec![2, 96];
        assert_eq!(broken(&reshape).1, "is [2, 96], expected [192]");
        let foreign =
            |t: &mut BTreeMap<String, Tensor>| t.get_mut("features.0.weight").unwrap().shape = vec![64, 3, 7, 7];
        assert!(broken(&foreign).1.contains("AlexNet has"));
        let edit = |t: &mut BTreeMap<String, Tensor>| t.get_mut("features.0.bias").unwrap().values[3] = f32::NAN;
        assert!(broken(&edit).1.contains("not finite"));
    }
}
