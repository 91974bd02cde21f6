//! Names of files and of places in the page, made from names that may hold anything.

/// The overview's file.
pub(super) const OVERVIEW: &str = "overview.svg";
/// Longest part that comes from a scene's or a picture's name, bytes.
const LONGEST: usize = 40;

/// Start of the names of a scene's files. The number keeps scenes of one name apart.
pub(super) fn stem(scene: usize, name: &str) -> String {
    format!("{:02}-{}", scene + 1, slug(name))
}

/// A picture's file.
pub(super) fn picture(stem: &str, number: usize, title: &str) -> String {
    format!("{stem}-picture-{}-{}.png", number + 1, slug(title))
}

/// The place of a scene in the page.
pub(super) fn anchor(scene: usize) -> String {
    format!("scene-{}", scene + 1)
}

/// Lower-case letters and digits of ASCII, all else as single hyphens: a name on every system, and in every attribute.
fn slug(name: &str) -> String {
    let mut slug = String::new();
    for c in name.chars() {
        if c.is_ascii_alphanumeric() {
            slug.push(c.to_ascii_lowercase());
        } else if !slug.is_empty() && !slug.ends_with('-') {
            slug.push('-');
        }
        if slug.len() >= LONGEST {
            break;
        }
    }
    let slug = slug.trim_end_matches('-');
    if slug.is_empty() { "unnamed".to_owned() } else { slug.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_leaves_the_folder_or_the_attribute() {
        assert_eq!(stem(0, "sponza_crytek"), "01-sponza-crytek");
        assert_eq!(stem(11, "../../etc/<script>\"ü\".obj"), "12-etc-script-obj");
        assert_eq!(stem(1, "日本"), "02-unnamed");
        assert_eq!(slug(&"x".repeat(300)).len(), LONGEST);
        assert_eq!(
            picture("01-a", 0, "view 1, tests per pixel, lbvh"),
            "01-a-picture-1-view-1-tests-per-pixel-lbvh.png"
        );
    }
}
