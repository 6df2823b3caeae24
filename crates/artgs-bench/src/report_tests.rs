use super::*;
use crate::paper;
use crate::testing::{collected, failed, record};

const NASTY: &str = "<script src=\"http://evil\">|`x`";

fn example() -> Collected {
    let mut records = vec![
        record("full", "a", 0, 0.1),
        record("full", "a", 1, 0.3),
        failed("full", "b", 0, NASTY),
        failed("full", "b", 1, "bang"),
    ];
    records[0].facts.views = 20;
    let mut all = collected(&["full"], &["a", "b"], records);
    all.objects[0].stands_for = paper::find("paris/usb");
    all
}

fn how() -> Circumstances {
    let command = "artgs bench a b -o 'x y' --seeds 2".into();
    Circumstances { command, threads: 4, jobs: 1, parts_given: true, stopped_after_discover: false }
}

#[test]
fn markdown_as_people_read_it() {
    let dir = tempfile::tempdir().unwrap();
    let files = write_report(dir.path(), &example(), &how()).unwrap();
    let text = std::fs::read_to_string(&files.markdown).unwrap();
    let expected = "# artgs benchmark

Made by

    artgs bench a b -o 'x y' --seeds 2

artgs 0.1.0: 4 runs, 2 failed; 4 threads, one run at a time. The number of parts was given. Trained on CPU (AVX2, 4 threads).

## Every object
";
    assert!(text.starts_with(expected), "{text}");
    let lines: Vec<&str> = text.lines().collect();
    for line in [
        "| Object | K | Variant | Axis Ang | Axis Pos | Motion (deg) | CD-s | CD-m | CD-w | PSNR | SSIM | Time (min) | \
         Memory (MiB) | Failures |",
        "| a | 2 | full | 0.200±0.141 | 0.200±0.141 | 0.200±0.141 | 0.20±0.14 | 0.20±0.14 | 0.20±0.14 | 31.00±0.00 | \
         0.980±0.000 | 1.50±0.00 | 512±0 | none |",
        "| b | 3 | full | F | F | F | F | F | F | F | F | F | F | 2 failed |",
        "## PARIS objects, two parts",
        "| Axis Ang | PARIS\\* | 0.71±0.8 |",
        "| *Axis Ang* | *artgs full (stand-in)* | *0.20±0.14* |",
        "| full | b | 0 | \\<script src=\"http://evil\"\\>\\|\\`x\\` | runs/full/b/seed\\_0.log |",
    ] {
        let line = line.replace("seed\\_0", "seed_0");
        assert!(lines.contains(&line.as_str()), "{line}\nis not in\n{text}");
    }
    // Every row of a table has as many cells as its head.
    for pair in lines.windows(2).filter(|p| p[0].starts_with('|') && p[1].starts_with('|')) {
        let cells = |l: &str| l.replace("\\|", "").matches('|').count();
        assert_eq!(cells(pair[0]), cells(pair[1]), "{}\n{}", pair[0], pair[1]);
    }
}

#[test]
fn the_page_is_well_formed_and_refers_to_nothing_outside() {
    let dir = tempfile::tempdir().unwrap();
    let preview = dir.path().join("runs/full/a/seed_1/preview.png");
    artgs_io::image_io::write_rgb(&preview, 12, 4, &[[9, 8, 7]; 48]).unwrap();
    let files = write_report(dir.path(), &example(), &how()).unwrap();
    let page = std::fs::read_to_string(&files.html).unwrap();
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() };
    let document = roxmltree::Document::parse_with_options(&page, options).unwrap();
    let count = |name: &str| document.descendants().filter(|n| n.has_tag_name(name)).count();
    assert_eq!((count("script"), count("link"), count("a"), count("iframe")), (0, 0, 0, 0));
    assert_eq!((count("img"), count("svg")), (1, 4));
    assert_eq!(count("table"), 5);
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        for attribute in node.attributes().filter(|a| matches!(a.name(), "src" | "href" | "data" | "style")) {
            assert!(attribute.value().starts_with("data:image/png;base64,"), "{attribute:?}");
        }
    }
    assert!(!page.contains("url(") && !page.contains("@import") && !page.contains("<script"));
    assert!(document.descendants().any(|n| n.text().is_some_and(|t| t.contains(NASTY))), "shown as it is");
}

#[test]
fn results_hold_records_and_aggregates_and_the_same_data_gives_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let read = |files: &Files| [&files.markdown, &files.json, &files.html].map(|f| std::fs::read(f).unwrap());
    let files = write_report(dir.path(), &example(), &how()).unwrap();
    let once = read(&files);
    let results: Value = serde_json::from_slice(&once[1]).unwrap();
    let angle = &results["aggregates"][0]["metrics"]["axis_ang"];
    assert!((angle["mean"].as_f64().unwrap() - 0.2).abs() < 1e-12 && angle["runs"] == 2);
    assert_eq!(results["aggregates"][1]["failures"]["failed"], 2);
    assert_eq!(results["objects"][0]["paper_object"], "paris/usb");
    let records: Vec<Record> = serde_json::from_value(results["records"].clone()).unwrap();
    assert_eq!(records, example().records);
    assert_eq!(read(&write_report(dir.path(), &example(), &how()).unwrap()), once);
}

#[test]
fn terminals_get_aligned_columns() {
    let text = overview(&example());
    let lines: Vec<&str> = text.lines().collect();
    let starts: Vec<_> = lines.iter().map(|l| l.find("full").or(l.find("Variant"))).collect();
    assert_eq!(lines.len(), 3);
    assert!(starts.iter().all(|s| *s == starts[0]), "{text}");
}
