//! The paper's tables: objects, columns, and the numbers of every method.

mod rows;

use crate::metric::{At, Metric, Surface};

/// A table of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// Ten synthetic and two real objects of two parts each.
    Paris,
    /// Two objects of three parts.
    DtaMulti,
    /// Five objects of four to seven parts.
    ArtgsMulti,
}

/// An object of the paper.
#[derive(Debug, PartialEq, Eq)]
pub struct PaperObject {
    /// Identifier in commands and suites, for example `paris/fridge`.
    pub id: &'static str,
    /// Name in the tables.
    pub name: &'static str,
    /// Where its numbers are.
    pub table: Table,
    /// State whose surfaces the paper scores. The paper does not state it; it follows from its two PARIS tables. For objects
    /// with several parts it is unknown, and the mean of both states is used.
    pub reported: At,
}

const fn object(id: &'static str, name: &'static str, table: Table, reported: At) -> PaperObject {
    PaperObject { id, name, table, reported }
}

/// Every object, in the order of the tables.
pub static OBJECTS: [PaperObject; 19] = [
    object("paris/foldchair", "FoldChair", Table::Paris, At::Start),
    object("paris/fridge", "Fridge", Table::Paris, At::Start),
    object("paris/laptop", "Laptop", Table::Paris, At::End),
    object("paris/oven", "Oven", Table::Paris, At::Start),
    object("paris/scissor", "Scissor", Table::Paris, At::End),
    object("paris/stapler", "Stapler", Table::Paris, At::End),
    object("paris/usb", "USB", Table::Paris, At::Start),
    object("paris/washer", "Washer", Table::Paris, At::End),
    object("paris/blade", "Blade", Table::Paris, At::Start),
    object("paris/storage", "Storage", Table::Paris, At::End),
    object("paris/real_fridge", "Real Fridge", Table::Paris, At::Start),
    object("paris/real_storage", "Real Storage", Table::Paris, At::Start),
    object("dta_multi/fridge", "Fridge-m", Table::DtaMulti, At::Mean),
    object("dta_multi/storage", "Storage-m", Table::DtaMulti, At::Mean),
    object("artgs_multi/table_25493", "Table 25493 (4 parts)", Table::ArtgsMulti, At::Mean),
    object("artgs_multi/table_31249", "Table 31249 (5 parts)", Table::ArtgsMulti, At::Mean),
    object("artgs_multi/storage_45503", "Storage 45503 (4 parts)", Table::ArtgsMulti, At::Mean),
    object("artgs_multi/storage_47648", "Storage 47648 (7 parts)", Table::ArtgsMulti, At::Mean),
    object("artgs_multi/oven_101908", "Oven 101908 (4 parts)", Table::ArtgsMulti, At::Mean),
];

/// The object of that name.
pub fn find(id: &str) -> Option<&'static PaperObject> {
    OBJECTS.iter().find(|o| o.id == id)
}

/// Columns of the PARIS rows: objects, and where their means are.
pub const PARIS_COLUMNS: [&str; 14] = [
    "paris/foldchair",
    "paris/fridge",
    "paris/laptop",
    "paris/oven",
    "paris/scissor",
    "paris/stapler",
    "paris/usb",
    "paris/washer",
    "paris/blade",
    "paris/storage",
    ALL_SYNTHETIC,
    "paris/real_fridge",
    "paris/real_storage",
    ALL_REAL,
];

/// Column of the means over the synthetic objects.
pub const ALL_SYNTHETIC: &str = "all synthetic";
/// Column of the means over the real objects.
pub const ALL_REAL: &str = "all real";

const CD_S: Metric = Metric::Cd(Surface::Fixed, At::Reported);
const CD_M: Metric = Metric::Cd(Surface::Movable, At::Reported);
const CD_W: Metric = Metric::Cd(Surface::Whole, At::Reported);

/// Columns of DTA-Multi.
pub const DTA_COLUMNS: [Metric; 11] = [
    Metric::JointAxisAngle(0),
    Metric::JointAxisAngle(1),
    Metric::JointAxisPosition(0),
    Metric::JointAxisPosition(1),
    Metric::JointMotion(0),
    Metric::JointMotion(1),
    CD_S,
    Metric::JointCd(0),
    Metric::JointCd(1),
    CD_W,
    Metric::Minutes,
];

/// Columns of ArtGS-Multi.
pub const ARTGS_COLUMNS: [Metric; 7] =
    [Metric::AxisAngle, Metric::PaperAxisPosition, Metric::PaperMotion, CD_S, CD_M, CD_W, Metric::Minutes];

/// Metrics of the PARIS table, in its order, then those of pictures.
pub const PARIS_METRICS: [Metric; 10] = [
    Metric::AxisAngle,
    Metric::AxisPosition,
    Metric::PartMotion,
    CD_S,
    CD_M,
    CD_W,
    Metric::Minutes,
    Metric::Psnr,
    Metric::Ssim,
    Metric::Lpips,
];

/// Objects of the ablation table.
pub const ABLATION_OBJECTS: [&str; 2] = ["artgs_multi/storage_47648", "artgs_multi/oven_101908"];
/// Metrics of the ablation table, for each object.
pub const ABLATION_METRICS: [Metric; 6] =
    [Metric::AxisAngle, Metric::PaperAxisPosition, Metric::PaperMotion, CD_S, CD_M, CD_W];

/// A printed number: `15.79±29.3`, `0.01`, `F` for a wrong joint type, `-` for none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// As printed.
    pub text: &'static str,
    /// Mean, if it is a number.
    pub mean: Option<f64>,
    /// Standard deviation, if the table has it.
    pub std: Option<f64>,
}

impl Printed {
    fn new(text: &'static str) -> Self {
        let (mean, std) = text.split_once('±').map_or((text, None), |(m, s)| (m, Some(s)));
        Self { text, mean: mean.parse().ok(), std: std.and_then(|s| s.parse().ok()) }
    }
}

/// A row: numbers in the order of the table's columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Method; ArtGS is what the paper calls "Ours".
    pub method: &'static str,
    /// Numbers.
    pub values: Vec<Printed>,
}

fn row(method: &'static str, line: &'static str) -> Row {
    Row { method, values: line.split_whitespace().map(Printed::new).collect() }
}

/// Rows of a metric in the PARIS tables, values in the order of [`PARIS_COLUMNS`].
pub fn paris(metric: Metric) -> Vec<Row> {
    rows::PARIS.iter().filter(|r| r.0 == metric).map(|(_, method, line)| row(method, line)).collect()
}

/// Rows of an object in its table of several parts, values in the order of [`DTA_COLUMNS`] or [`ARTGS_COLUMNS`].
pub fn multi(object: &PaperObject) -> Vec<Row> {
    let table = match object.table {
        Table::Paris => &[],
        Table::DtaMulti => rows::DTA_MULTI,
        Table::ArtgsMulti => rows::ARTGS_MULTI,
    };
    table.iter().filter(|r| r.0 == object.id).map(|(_, method, line)| row(method, line)).collect()
}

/// Rows of an object in the ablation table, `method` being the variant; values in the order of [`ABLATION_METRICS`].
pub fn ablation(object: &PaperObject) -> Vec<Row> {
    let Some(block) = ABLATION_OBJECTS.iter().position(|id| *id == object.id) else { return Vec::new() };
    let width = ABLATION_METRICS.len();
    let part = |(variant, line)| {
        let Row { method, values } = row(variant, line);
        Row { method, values: values[block * width..(block + 1) * width].to_vec() }
    };
    rows::ABLATION.iter().copied().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_a_number_a_failure_or_nothing_in_every_column() {
        let full = |row: &Row, columns: usize| {
            assert_eq!(row.values.len(), columns, "{row:?}");
            for value in &row.values {
                assert!(value.mean.is_some() != matches!(value.text, "-" | "F"), "{value:?} in {row:?}");
                assert_eq!(value.std.is_some(), value.text.contains('±'));
            }
        };
        for metric in PARIS_METRICS {
            let rows = paris(metric);
            let methods = match metric {
                Metric::Minutes | Metric::Psnr | Metric::Ssim | Metric::Lpips => 2,
                _ => 6,
            };
            assert_eq!(rows.len(), methods, "{metric:?}");
            rows.iter().for_each(|row| full(row, 14));
        }
        for object in OBJECTS.iter().filter(|o| o.table != Table::Paris) {
            let (rows, columns) = if object.table == Table::DtaMulti { (3, 11) } else { (2, 7) };
            assert_eq!(multi(object).len(), rows, "{}", object.id);
            multi(object).iter().for_each(|row| full(row, columns));
        }
        for id in ABLATION_OBJECTS {
            let rows = ablation(find(id).unwrap());
            assert_eq!(rows.len(), 7);
            rows.iter().for_each(|row| full(row, 6));
        }
    }

    fn paris_text(metric: Metric, method: &str, object: &str) -> &'static str {
        let column = PARIS_COLUMNS.iter().position(|c| *c == object).unwrap();
        paris(metric).iter().find(|r| r.method == method).unwrap().values[column].text
    }

    #[test]
    fn numbers_agree_with_a_second_reading_of_the_paper() {
        assert_eq!(paris_text(Metric::AxisAngle, "Ditto", "paris/oven"), "0.96");
        assert_eq!(paris_text(Metric::AxisAngle, "PARIS*", "paris/blade"), "41.28±31.4");
        assert_eq!(paris_text(Metric::AxisAngle, "3Dseg-reg", "paris/laptop"), "2.34±0.11");
        assert_eq!(paris_text(Metric::AxisPosition, "CSG-reg", "paris/washer"), "2.13±1.5");
        assert_eq!(paris_text(Metric::AxisPosition, "ArtGS", "paris/blade"), "-");
        assert_eq!(paris_text(Metric::PartMotion, "Ditto", "paris/fridge"), "F");
        assert_eq!(paris_text(Metric::PartMotion, "Ditto", "paris/blade"), "F");
        assert_eq!(paris_text(Metric::PartMotion, "DTA", "paris/scissor"), "0.37±0.6");
        assert_eq!(paris_text(CD_S, "ArtGS", "paris/washer"), "6.43±0.1");
        assert_eq!(paris_text(CD_M, "PARIS*", "paris/real_storage"), "474.57±227.2");
        assert_eq!(paris_text(CD_M, "CSG-reg", "paris/usb"), "29.78");
        assert_eq!(paris_text(CD_W, "ArtGS", ALL_SYNTHETIC), "2.15±0.1");
        assert_eq!(paris_text(CD_W, "DTA", ALL_REAL), "5.53±0.1");
        assert_eq!(paris_text(Metric::Minutes, "DTA", "paris/usb"), "31");
        assert_eq!(paris_text(Metric::Psnr, "ArtGS", "paris/blade"), "41.16");
        assert_eq!(paris_text(Metric::Ssim, "PARIS", "paris/real_fridge"), "0.898");
        assert_eq!(paris_text(Metric::Lpips, "ArtGS", "paris/blade"), "0.004");
        let line = |id: &str, method: &str| {
            let row = multi(find(id).unwrap()).into_iter().find(|r| r.method == method).unwrap();
            row.values.iter().map(|v| v.text).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(line("dta_multi/storage", "DTA"), "0.17 0.40 0.04 - 0.13 0.00 0.86 0.20 0.25 0.97 32");
        assert_eq!(line("artgs_multi/storage_47648", "ArtGS"), "0.14 0.02 0.62 0.67 3.70 0.70 8");
        assert_eq!(line("artgs_multi/oven_101908", "DTA"), "17.83 6.51 31.80 1.17 359.16 1.01 35");
        let oven = ablation(find("artgs_multi/oven_101908").unwrap());
        let cano = oven.iter().find(|r| r.method == "w/o Cano. init.").unwrap();
        assert_eq!(cano.values[4].mean, Some(1030.19));
    }

    #[test]
    fn averages_of_the_typed_numbers_are_the_printed_averages() {
        for metric in [Metric::AxisAngle, CD_S, CD_M, CD_W, Metric::Psnr] {
            for row in paris(metric).iter().filter(|r| r.method != "3Dseg-reg") {
                let mean = row.values[..10].iter().filter_map(|v| v.mean).sum::<f64>() / 10.0;
                let printed = row.values[10].mean.unwrap();
                assert!((mean - printed).abs() < 0.02, "{metric:?} {}: {mean} against {printed}", row.method);
            }
        }
    }
}
