//! Which topics of a container hold colour, which depth, by their names and encodings.

use super::container::Topic;

/// Words in names of topics whose images are neither colour nor depth.
const NEITHER: [&str; 10] =
    ["ir", "infra", "infrared", "amplitude", "intensity", "confidence", "thermal", "disparity", "variance", "quality"];

/// Words of a name, in lower case, without digits.
fn words(name: &str) -> impl Iterator<Item = String> + '_ {
    let parts = name.split(|c: char| !c.is_ascii_alphabetic()).filter(|w| !w.is_empty());
    parts.map(str::to_ascii_lowercase)
}

/// True for infrared pictures, confidences and the like.
fn is_neither(name: &str) -> bool {
    words(name).any(|w| NEITHER.contains(&w.as_str()))
}

fn says_depth(name: &str) -> bool {
    words(name).any(|w| w.contains("depth"))
}

fn is_compressed(topic: &Topic) -> bool {
    topic.kind.ends_with("CompressedImage")
}

/// True for the format of `compressed_depth_image_transport`, such as `16UC1; compressedDepth png`.
fn is_compressed_depth(topic: &Topic, encoding: &str) -> bool {
    is_compressed(topic) && (encoding.contains("compressedDepth") || topic.name.ends_with("/compressedDepth"))
}

/// How well a topic suits as colour; 0: not at all. `encoding` is that of the pixels, or the format of a compressed image.
pub(super) fn color_score(topic: &Topic, encoding: &str) -> usize {
    let one_channel =
        ["16UC1", "32FC1", "mono16", "mono8", "8UC1"].iter().any(|e| encoding.trim_start().starts_with(e));
    let pixels = ["rgb8", "bgr8", "rgba8", "bgra8"].contains(&encoding);
    let usable = if is_compressed(topic) { !one_channel && !is_compressed_depth(topic, encoding) } else { pixels };
    let name = topic.name.to_ascii_lowercase();
    // Depth that is aligned to colour has both words.
    if !usable || words(&name).any(|w| w == "depth") || is_neither(&name) {
        return 0;
    }
    if name.contains("color") || name.contains("rgb") { 2 } else { 1 }
}

/// How well a topic suits as depth; 0: not at all. 16 bits that only call themselves grey are depth if the name says so.
pub(super) fn depth_score(topic: &Topic, encoding: &str) -> usize {
    let name = topic.name.to_ascii_lowercase();
    let usable = match encoding {
        "16UC1" | "32FC1" => true,
        "mono16" => says_depth(&name),
        _ => is_compressed_depth(topic, encoding),
    };
    if !usable || is_neither(&name) {
        return 0;
    }
    // Of the same depth, images without compression need no decoder.
    let raw = usize::from(!is_compressed(topic));
    match (name.contains("aligned") || name.contains("registered"), says_depth(&name)) {
        (true, _) => 5 + raw,
        (false, true) => 3 + raw,
        (false, false) => 1 + raw,
    }
}

/// Why a topic that seems to hold depth cannot be read, with the remedy; none if it does not seem to.
pub(super) fn refusal(topic: &Topic, encoding: &str) -> Option<String> {
    let name = &topic.name;
    if is_neither(name) || !(says_depth(name) || encoding.starts_with("16UC1") || encoding == "mono16") {
        return None;
    }
    if depth_score(topic, encoding) > 0 {
        return None;
    }
    let base = name.strip_suffix("/compressed").unwrap_or(name);
    Some(if is_compressed(topic) {
        format!(
            "{name} holds JPEG or PNG pictures ({}): JPEG is no depth; record {base}/compressedDepth, or {base} itself",
            encoding.trim()
        )
    } else if encoding == "mono16" {
        format!(
            "{name} is mono16, and its name does not say that it is depth; record a topic of depth (16UC1 or 32FC1)"
        )
    } else {
        format!("{name} is {encoding}, which are not distances; record a topic of 16UC1 or 32FC1")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str, kind: &str) -> Topic {
        Topic { name: name.into(), kind: format!("sensor_msgs/{kind}"), cdr: true }
    }

    #[test]
    fn infrared_is_neither_colour_nor_depth() {
        for name in [
            "/ir/image_raw",
            "/camera/infra1/image_rect_raw",
            "/kinect2/sd/image_ir_rect",
            "/device_0/Infrared_1/image/data",
        ] {
            for encoding in ["mono16", "16UC1", "mono8"] {
                let topic = topic(name, "Image");
                assert_eq!((depth_score(&topic, encoding), color_score(&topic, encoding)), (0, 0), "{name} {encoding}");
                assert_eq!(refusal(&topic, encoding), None);
            }
        }
        assert_eq!(color_score(&topic("/ir/image_raw/compressed", "CompressedImage"), "jpeg"), 0);
        // The word is not looked for inside of others.
        assert!(color_score(&topic("/airsim/color/image", "Image"), "rgb8") == 2);
        assert!(depth_score(&topic("/first/depth/image", "Image"), "mono16") > 0);
    }

    #[test]
    fn the_best_depth_is_chosen() {
        let score = |name: &str, kind, encoding| depth_score(&topic(name, kind), encoding);
        let aligned = score("/camera/aligned_depth_to_color/image_raw", "Image", "16UC1");
        let packed = score(
            "/camera/aligned_depth_to_color/image_raw/compressedDepth",
            "CompressedImage",
            "16UC1; compressedDepth png",
        );
        let own = score("/camera/depth/image_rect_raw", "Image", "16UC1");
        assert!(aligned > packed && packed > own && own > score("/sensor/image", "Image", "16UC1"));
        assert_eq!(score("/camera/depth/image/compressed", "CompressedImage", "16UC1; jpeg compressed "), 0);
        assert_eq!(
            color_score(&topic("/camera/aligned_depth_to_color/image_raw/compressed", "CompressedImage"), "jpeg"),
            0
        );
    }

    #[test]
    fn pictures_of_depth_are_refused_by_name() {
        let jpeg = topic("/camera/depth/image_raw/compressed", "CompressedImage");
        let text = refusal(&jpeg, "16UC1; jpeg compressed ").unwrap();
        assert!(
            text.contains("JPEG is no depth") && text.contains("/camera/depth/image_raw/compressedDepth"),
            "{text}"
        );
        assert!(refusal(&topic("/depth/image", "Image"), "rgb8").unwrap().contains("rgb8"));
        assert_eq!(refusal(&topic("/color/image", "Image"), "rgb8"), None);
    }
}
