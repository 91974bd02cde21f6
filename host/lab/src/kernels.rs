//! What drivers make of the kernels, as a table.

use crate::terminal::STYLE;
use comfy_table::{Cell, CellAlignment, ContentArrangement, Table};
use prbvh::device::vulkan::KernelStatistics;

/// A row for each executable, a column for each statistic that any of them has. What is the same for all stands in a line below; hashes are left out.
#[must_use]
pub fn table(kernels: &[KernelStatistics]) -> String {
    let codes = || kernels.iter().flat_map(|kernel| kernel.executables.iter().map(move |code| (kernel, code)));
    let mut names: Vec<&str> = Vec::new();
    for statistic in codes().flat_map(|(_, code)| &code.statistics) {
        if !names.contains(&statistic.name.as_str()) && !statistic.name.to_lowercase().contains("hash") {
            names.push(&statistic.name);
        }
    }

    let mut columns = vec![("kernel", codes().map(|(kernel, _)| kernel.kernel.to_owned()).collect::<Vec<_>>())];
    if kernels.iter().any(|kernel| kernel.executables.len() > 1) {
        columns.push(("executable", codes().map(|(_, code)| code.name.clone()).collect()));
    }
    let texts = columns.len();
    columns.push(("lanes", codes().map(|(_, code)| code.subgroup_size.to_string()).collect()));
    columns.extend(names.into_iter().map(|name| {
        let of = |statistic: &&prbvh::device::vulkan::Statistic| statistic.name == name;
        let shown = codes().map(|(_, code)| code.statistics.iter().find(of).map(|found| found.value.to_string()));
        (name, shown.map(Option::unwrap_or_default).collect())
    }));

    let is_same = |cells: &[String]| cells.len() > 1 && cells.iter().all(|cell| *cell == cells[0]);
    let numbers = columns.split_off(texts);
    let (same, different): (Vec<_>, Vec<_>) = numbers.into_iter().partition(|(_, cells)| is_same(cells));
    columns.extend(different);
    let cell = |k: usize, text: &str| {
        Cell::new(text).set_alignment(if k < texts { CellAlignment::Left } else { CellAlignment::Right })
    };
    let mut table = Table::new();
    table.load_style(STYLE).set_content_arrangement(ContentArrangement::Disabled);
    // A word a line, as numbers are narrow.
    table.set_header(columns.iter().enumerate().map(|(k, (name, _))| cell(k, &name.replace(' ', "\n"))));
    for row in 0..codes().count() {
        table.add_row(columns.iter().enumerate().map(|(k, (_, cells))| cell(k, &cells[row])));
    }
    let mut text = table.trim_fmt();
    if !same.is_empty() {
        let same: Vec<_> = same.iter().map(|(name, cells)| format!("{name} {}", cells[0])).collect();
        text.push_str(&format!("\nall: {}", same.join(", ")));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh::device::vulkan::{Executable, Statistic, StatisticValue};

    fn code(name: &str, lanes: u32, statistics: &[(&str, StatisticValue)]) -> Executable {
        let statistic = |&(name, value): &(&str, _)| Statistic { name: name.into(), description: String::new(), value };
        Executable { name: name.into(), subgroup_size: lanes, statistics: statistics.iter().map(statistic).collect() }
    }

    #[test]
    fn executables_are_rows_and_what_is_the_same_for_all_is_said_once() {
        use StatisticValue::{Float, Unsigned};
        let search = [("VGPRs", Unsigned(84)), ("Spilled VGPRs", Unsigned(0)), ("Hash", Unsigned(77_177))];
        let refit = [("VGPRs", Unsigned(9)), ("Spilled VGPRs", Unsigned(0)), ("Latency", Float(1.5))];
        let mut kernels = [
            KernelStatistics { kernel: "dual_search", executables: vec![code("SIMD16", 16, &search)] },
            KernelStatistics { kernel: "refit", executables: vec![code("SIMD16", 16, &refit)] },
        ];
        let lines = |kernels: &[KernelStatistics]| -> Vec<Vec<String>> {
            let text = table(kernels);
            text.lines().map(|line| line.split_whitespace().map(str::to_owned).collect()).collect()
        };
        let one_each = lines(&kernels);
        assert!(one_each.contains(&["kernel", "VGPRs", "Latency"].map(str::to_owned).to_vec()), "{one_each:?}");
        assert!(one_each.contains(&["dual_search", "84"].map(str::to_owned).to_vec()), "{one_each:?}");
        assert!(one_each.contains(&["refit", "9", "1.5"].map(str::to_owned).to_vec()), "{one_each:?}");
        assert!(one_each.last().unwrap().join(" ") == "all: lanes 16, Spilled VGPRs 0", "{one_each:?}");
        assert!(!table(&kernels).contains("77177"));

        kernels[1].executables.push(code("SIMD32", 32, &[("VGPRs", Unsigned(9)), ("Spilled VGPRs", Unsigned(3))]));
        let several = lines(&kernels);
        assert!(several.contains(&["refit", "SIMD32", "32", "9", "3"].map(str::to_owned).to_vec()), "{several:?}");
        assert!(table(&[]).contains("kernel"));
    }
}
