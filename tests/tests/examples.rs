//! The examples of the library run and say what they should.

use prbvh_tests::devices::without_vulkan;
use std::process::Command;

/// What an example printed.
fn run(program: &str) -> String {
    let output = Command::new(program).output().unwrap();
    assert!(output.status.success(), "{program}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The numbers of a line.
fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn a_tree_is_left_in_a_buffer_of_the_caller() {
    if without_vulkan() {
        println!("not run: a_tree_is_left_in_a_buffer_of_the_caller (PRBVH_WITHOUT_VULKAN=1)");
        return;
    }
    let printed = run(env!("CARGO_BIN_EXE_example-your-vulkan"));
    let (_, said) = printed.split_once(": ").unwrap();
    let [nodes, optimized, initial] = numbers(said)[..] else { panic!("{printed}") };
    assert!(nodes == 3999.0 && optimized < 0.8 * initial, "{printed}");
}

#[test]
fn a_tree_of_another_library_comes_in_and_one_of_ours_goes_out() {
    let printed = run(env!("CARGO_BIN_EXE_example-other-libraries"));
    let costs = numbers(&printed.replace(',', ""));
    assert!(costs.len() == 2 && costs[1] > 0.0 && costs[0] > 0.5 * costs[1], "{printed}");
}
