//! Farthest point sampling.

/// Most points of a bucket.
const BUCKET: usize = 64;
/// Consecutive buckets, which are neighbours, that are skipped together.
const GROUP: usize = 32;
const LANES: usize = 8;

/// A box of neighbouring points, and the one among them farthest from all samples.
struct Bucket {
    start: usize,
    end: usize,
    low: [f32; 3],
    high: [f32; 3],
    /// Largest squared distance to the nearest sample.
    far: f32,
    /// Where that point is; of several the one with the lowest index.
    far_at: usize,
}

/// Points in the order of their buckets, coordinate by coordinate.
struct Cloud {
    coordinates: [Vec<f32>; 3],
    index: Vec<u32>,
    /// Squared distance to the nearest sample; -1 for samples.
    nearest: Vec<f32>,
}

/// Indices of `count` points (all, if there are fewer), each farthest from those before it, starting with point 0.
/// Ties go to the lowest index. Buckets whose box is farther from a new sample than any of their points is from the
/// old ones are skipped, which leaves the result that of the plain algorithm.
pub fn farthest_points(points: &[[f32; 3]], count: usize) -> Vec<usize> {
    let count = count.min(points.len());
    if count == 0 {
        return Vec::new();
    }
    let (mut cloud, mut buckets) = partition(points);
    let mut groups: Vec<Bucket> = buckets.chunks(GROUP).map(Bucket::around).collect();
    let mut samples = Vec::with_capacity(count);
    let mut at = cloud.index.iter().position(|&i| i == 0).unwrap_or(0);
    loop {
        samples.push(cloud.index[at] as usize);
        if samples.len() == count {
            return samples;
        }
        let sample = [0, 1, 2].map(|a| cloud.coordinates[a][at]);
        cloud.nearest[at] = -1.0;
        for (group, members) in groups.iter_mut().zip(buckets.chunks_mut(GROUP)) {
            if group.distance(sample) > group.far {
                continue;
            }
            for bucket in members.iter_mut() {
                if bucket.distance(sample) <= bucket.far {
                    bucket.update(&mut cloud, sample);
                }
            }
            (group.far, group.far_at) = farthest(&cloud, members);
        }
        at = farthest(&cloud, &groups).1;
    }
}

/// The largest `far` of some buckets and where it is; of several the one with the lowest index.
fn farthest(cloud: &Cloud, buckets: &[Bucket]) -> (f32, usize) {
    let mut best = (buckets[0].far, buckets[0].far_at);
    for bucket in &buckets[1..] {
        let tie = bucket.far == best.0 && cloud.index[bucket.far_at] < cloud.index[best.1];
        if bucket.far > best.0 || tie {
            best = (bucket.far, bucket.far_at);
        }
    }
    best
}

/// Splits at medians of the longest side until buckets are small.
fn partition(points: &[[f32; 3]]) -> (Cloud, Vec<Bucket>) {
    let mut index: Vec<u32> = (0..points.len() as u32).collect();
    let mut buckets = Vec::new();
    let mut stack = vec![(0, points.len())];
    while let Some((start, end)) = stack.pop() {
        let members = &mut index[start..end];
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for &i in members.iter() {
            for a in 0..3 {
                low[a] = low[a].min(points[i as usize][a]);
                high[a] = high[a].max(points[i as usize][a]);
            }
        }
        if members.len() <= BUCKET {
            buckets.push(Bucket { start, end, low, high, far: f32::INFINITY, far_at: start });
            continue;
        }
        let side = |a: usize| high[a] - low[a];
        let axis = (1..3).fold(0, |best, a| if side(a) > side(best) { a } else { best });
        let middle = members.len() / 2;
        members.select_nth_unstable_by(middle, |&i, &j| {
            points[i as usize][axis].total_cmp(&points[j as usize][axis]).then(i.cmp(&j))
        });
        stack.extend([(start + middle, end), (start, start + middle)]);
    }
    let coordinates = [0, 1, 2].map(|a| index.iter().map(|&i| points[i as usize][a]).collect());
    (Cloud { coordinates, index, nearest: vec![f32::INFINITY; points.len()] }, buckets)
}

impl Bucket {
    /// Around buckets that no sample has touched.
    fn around(buckets: &[Self]) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (bucket, a) in buckets.iter().flat_map(|b| (0..3).map(move |a| (b, a))) {
            low[a] = low[a].min(bucket.low[a]);
            high[a] = high[a].max(bucket.high[a]);
        }
        let (start, end) = (buckets[0].start, buckets[buckets.len() - 1].end);
        Self { start, end, low, high, far: f32::INFINITY, far_at: start }
    }

    /// Squared distance from the box; never above that from any point in it, rounding included.
    fn distance(&self, p: [f32; 3]) -> f32 {
        let side = |a: usize| (self.low[a] - p[a]).max(p[a] - self.high[a]).max(0.0);
        let (x, y, z) = (side(0), side(1), side(2));
        x * x + y * y + z * z
    }

    fn update(&mut self, cloud: &mut Cloud, p: [f32; 3]) {
        let range = self.start..self.end;
        let [xs, ys, zs] = &cloud.coordinates;
        let (xs, ys, zs) = (&xs[range.clone()], &ys[range.clone()], &zs[range.clone()]);
        let nearest = &mut cloud.nearest[range.clone()];
        for i in 0..nearest.len() {
            let (x, y, z) = (xs[i] - p[0], ys[i] - p[1], zs[i] - p[2]);
            let square = x * x + y * y + z * z;
            nearest[i] = if square < nearest[i] { square } else { nearest[i] };
        }
        let mut highest = [-1.0f32; LANES];
        let chunks = nearest.chunks_exact(LANES);
        let rest = chunks.remainder();
        for chunk in chunks {
            for l in 0..LANES {
                highest[l] = if chunk[l] > highest[l] { chunk[l] } else { highest[l] };
            }
        }
        self.far = rest.iter().chain(&highest).fold(-1.0, |a, &b| a.max(b));
        self.far_at =
            range.filter(|&i| cloud.nearest[i] == self.far).min_by_key(|&i| cloud.index[i]).unwrap_or(self.start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_pcg::Pcg64Mcg;

    fn plain(points: &[[f32; 3]], count: usize) -> Vec<usize> {
        let mut nearest = vec![f32::INFINITY; points.len()];
        let mut samples = vec![0];
        while samples.len() < count {
            let p = points[samples[samples.len() - 1]];
            nearest[samples[samples.len() - 1]] = -1.0;
            for (d, q) in nearest.iter_mut().zip(points) {
                let (x, y, z) = (q[0] - p[0], q[1] - p[1], q[2] - p[2]);
                *d = d.min(x * x + y * y + z * z);
            }
            samples.push((0..points.len()).fold(0, |best, i| if nearest[i] > nearest[best] { i } else { best }));
        }
        samples
    }

    #[test]
    fn same_as_the_plain_algorithm_also_with_ties_and_duplicates() {
        let mut rng = Pcg64Mcg::new(1);
        let mut clouds: Vec<Vec<[f32; 3]>> = vec![vec![[1.0; 3]; 90]];
        clouds.push((0..2000).map(|_| std::array::from_fn(|_| rng.random::<f32>())).collect());
        clouds.push((0..1000).map(|i| [(i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32]).collect());
        for cloud in &clouds {
            for count in [1, 7, 80] {
                assert_eq!(farthest_points(cloud, count), plain(cloud, count));
            }
            let mut all = farthest_points(cloud, usize::MAX);
            all.sort_unstable();
            assert!(all.iter().enumerate().all(|(i, &j)| i == j) && all.len() == cloud.len());
        }
        assert!(farthest_points(&[], 5).is_empty());
    }
}
