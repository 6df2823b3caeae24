//! Exports the page to one file that needs no server.

use crate::bundle::{HTML, POLICY, SCRIPT, STYLE};
use crate::{Page, ViewError};
use artgs_io::{FileError, write_atomic};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write as _;
use std::path::Path;

/// Lines of `dist/index.html` that refer to other files.
const LINK: &str = "<link rel=\"stylesheet\" href=\"viewer.css\">";
const CODE: &str = "<script type=\"module\" src=\"viewer.js\"></script>";

/// Starts the embedded script: it is packed as the files are, to a third of its size.
const START: &str = r#"<script type="module">
const packed = Uint8Array.from(atob(document.querySelector('[data-file="viewer.js"]').textContent), (c) => c.charCodeAt(0));
const code = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
await import(URL.createObjectURL(new Blob([code], { type: "text/javascript" })));
</script>"#;

/// Writes a page that can be opened from disk; see [`page_html`].
pub fn export_page(page: &Page, file: &Path) -> Result<(), ViewError> {
    Ok(write_atomic(file, page_html(page)?.as_bytes())?)
}

/// A page with embedded style, script, scene and files (gzip, base 64), textures as JPEG: it loads nothing.
pub fn page_html(page: &Page) -> Result<String, ViewError> {
    let mut page = page.clone();
    page.scene.corrections = false;
    page.scene.rerun = None;
    let mut data = String::new();
    for (name, source) in &page.files {
        let bytes = source.read()?;
        let photo =
            page.scene.links.iter_mut().filter_map(|link| link.mesh.as_mut()?.texture.as_mut()).find(|t| *t == name);
        match photo.and_then(|texture| Some((smaller(&bytes)?, texture))) {
            Some((jpeg, texture)) => {
                *texture = name.replace(".png", ".jpg");
                data += &element(texture, &jpeg)?;
            }
            None if name.ends_with(".obj") => data += &element(name, rounded(&bytes).as_bytes())?,
            None => data += &element(name, &bytes)?,
        }
    }
    data += &element("scene.json", page.scene_json()?.as_bytes())?;
    data += &element("viewer.js", SCRIPT.as_bytes())?;
    // A meta element does not support frame-ancestors; scripts and styles are inline here.
    let policy = POLICY.replace("; frame-ancestors 'none'", "").replace("'self'", "'unsafe-inline'");
    let head = format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\n<style>{STYLE}</style>");
    let code = data + START;
    Ok(HTML.replacen(LINK, &head, 1).replacen(CODE, &code, 1))
}

/// A texture as JPEG; none if that is no smaller, or if it cannot be read.
fn smaller(png: &[u8]) -> Option<Vec<u8>> {
    /// Quality of 100: differences are not visible beside photos of a phone.
    const QUALITY: u8 = 80;
    let image = image::load_from_memory(png).ok()?.into_rgb8();
    let mut jpeg = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, QUALITY).encode_image(&image).ok()?;
    (jpeg.len() < png.len()).then_some(jpeg)
}

/// The text of a mesh with no more digits than can be seen: a third of a page would be digits. Positions keep at least a five-thousandth of the
/// size of the object, normals half a degree, texture coordinates a fifth of a texel of 2048.
fn rounded(mesh: &[u8]) -> String {
    /// Steps along the largest coordinate.
    const STEPS: f64 = 5_000.0;
    let text = String::from_utf8_lossy(mesh);
    let coordinates = |line: &str| line.split(' ').skip(1).filter_map(|n| n.parse::<f64>().ok()).collect::<Vec<_>>();
    let points = text.lines().filter(|line| line.starts_with("v ")).flat_map(coordinates);
    let largest = points.fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let digits = if largest > 0.0 { (STEPS / largest).log10().ceil().clamp(0.0, 9.0) as usize } else { 0 };
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let (key, rest) = line.split_once(' ').unwrap_or((line, ""));
        let digits = match key {
            "v" => digits,
            "vn" => 2,
            "vt" => 4,
            _ => {
                out.push_str(line);
                out.push('\n');
                continue;
            }
        };
        out.push_str(key);
        for number in rest.split(' ') {
            let shorter = number.parse::<f64>().map_or(number.to_string(), |x| format!("{x:.digits$}"));
            let bare =
                if shorter.contains('.') { shorter.trim_end_matches('0').trim_end_matches('.') } else { &shorter };
            out.push(' ');
            out.push_str(bare);
        }
        out.push('\n');
    }
    out
}

/// An inert script element that contains a file.
fn element(name: &str, bytes: &[u8]) -> Result<String, FileError> {
    let fail = |source| FileError::Write { path: name.into(), source };
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).map_err(fail)?;
    let packed = STANDARD.encode(encoder.finish().map_err(fail)?);
    Ok(format!("<script type=\"text/plain\" data-file=\"{name}\">{packed}</script>\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_become_jpeg_and_flat_colours_stay_png() {
        let png = |color: &dyn Fn(u32, u32) -> u8| {
            let image = image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([color(x, y); 3]));
            let mut png = std::io::Cursor::new(Vec::new());
            image.write_to(&mut png, image::ImageFormat::Png).unwrap();
            png.into_inner()
        };
        let noise = |x: u32, y: u32| (128 + 40 * ((x * 7919 + y * 104_729) % 3)) as u8;
        let photo = png(&noise);
        let jpeg = smaller(&photo).unwrap();
        assert!(jpeg.len() < photo.len());
        let back = image::load_from_memory(&jpeg).unwrap().into_rgb8();
        let off = |(x, y, p): (u32, u32, &image::Rgb<u8>)| f64::from(p[0].abs_diff(noise(x, y)));
        let mean = back.enumerate_pixels().map(off).sum::<f64>() / 4096.0;
        assert!(mean < 8.0, "{mean}");
        assert_eq!(smaller(&png(&|_, _| 200)), None);
        assert_eq!(smaller(b"no picture"), None);
    }

    #[test]
    fn meshes_lose_digits_that_nobody_sees() {
        let mesh = "# artgs\nv -0.4007704 1.3207212 0\nvt 0.45204014 1\nvn -0.53935903 -0.16617663 -0.82551634\nf 1/1/1 2/2/2 3/3/3\n";
        let short = "# artgs\nv -0.4008 1.3207 0\nvt 0.452 1\nvn -0.54 -0.17 -0.83\nf 1/1/1 2/2/2 3/3/3\n";
        assert_eq!(rounded(mesh.as_bytes()), short);
        assert_eq!(rounded(b"v 4007.704 -3.2072 10\n"), "v 4007.7 -3.2 10\n");
        assert_eq!(rounded(b"v 0 0 0\nv 1e-9 0 x\n"), "v 0 0 0\nv 0.000000001 0 x\n");
    }

    #[test]
    fn the_built_page_has_the_replaced_lines() {
        assert_eq!((HTML.matches(LINK).count(), HTML.matches(CODE).count()), (1, 1));
        assert!(!SCRIPT.contains("</script") && !STYLE.contains("</style"));
        assert!(!SCRIPT.contains("sourceMappingURL"));
    }
}
