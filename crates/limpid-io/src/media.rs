//! Media by name, with measured coefficients.

use std::fmt;
use std::str::FromStr;

use glam::Vec3;
use limpid::scene::{Liquid, Medium};
use serde::{Deserialize, Serialize};

/// The name of a medium.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MediumName {
    /// Whole milk.
    Milk,
    /// Skimmed milk.
    SkimmedMilk,
    /// A river with 200 g of silt in a cubic metre.
    MuddyRiver,
    /// Sea water of a coast.
    Sea,
    /// Espresso.
    Coffee,
    /// A drink of orange powder.
    OrangeJuice,
    /// Whole blood that carries oxygen.
    Blood,
    /// Light amber honey.
    Honey,
}

/// A row of [`TABLE`]: name, absorption and scattering in 1/m, anisotropy, index of refraction.
type Row = (MediumName, &'static str, [f32; 3], [f32; 3], f32, f32);

/// The media, at about 650, 550 and 450 nm. The sources:
///
/// - milk and skimmed milk: Jensen, Marschner, Levoy and Hanrahan, A practical model for subsurface light transport,
///   2001, figure 5; scattering is the reduced σs(1 − g);
/// - coffee (espresso) and orange juice (powder): Narasimhan et al., Acquiring scattering properties of participating
///   media by dilution, 2006, table 2; one mean g with their σs(1 − g);
/// - muddy river: 0.51 m²/g of scattering, the mean of coastal particles at 555 nm (Babin, Morel et al., Light
///   scattering properties of marine particles, 2003), and 0.041 exp(−0.0123 (λ − 443 nm)) m²/g of absorption by
///   particles that are not algae (Babin, Stramski et al., Variations in the light absorption coefficients, 2003), in
///   pure water (Pope and Fry 1997);
/// - sea: the coastal water of San Pedro Channel (Petzold 1972), 0.179 and 0.219 1/m at 514 nm, with pure water's share
///   of the absorption, the rest as exp(−0.014 λ/nm), scattering as 1/λ; g of his mean particle phase function
///   (Mobley 1994);
/// - blood: 150 g/l of oxyhaemoglobin (Prahl 1999); scattering and g after Bosschaart et al. 2014;
/// - honey: 40 mm on Pfund's scale, which is −38.7 + 371.39 times the absorbance at 635 nm of 1 cm of a solution of
///   50 g in 100 ml (White 1984), with a slope of exp(−0.012 λ/nm); clear.
const TABLE: [Row; 8] = {
    use MediumName as M;
    [
        (M::Milk, "milk", [1.1, 2.4, 14.0], [2550.0, 3210.0, 3770.0], 0.0, 1.3),
        (M::SkimmedMilk, "skimmed-milk", [1.4, 2.5, 14.2], [700.0, 1220.0, 1900.0], 0.0, 1.3),
        (M::MuddyRiver, "muddy-river", [0.98, 2.26, 7.53], [102.0, 102.0, 102.0], 0.92, 1.33),
        (M::Sea, "sea", [0.36, 0.14, 0.347], [0.173, 0.205, 0.25], 0.924, 1.34),
        (M::Coffee, "coffee", [4798.0, 6575.0, 8849.0], [6828.0, 7977.0, 9667.0], 0.894, 1.33),
        (M::OrangeJuice, "orange-juice", [1.45, 3.44, 7.86], [1.96, 2.18, 2.2], 0.92, 1.33),
        (M::Blood, "blood", [197.0, 23.0e3, 33.6e3], [90e3, 90e3, 90e3], 0.98, 1.37),
        (M::Honey, "honey", [116.0, 386.0, 1280.0], [0.0; 3], 0.0, 1.49),
    ]
};

impl MediumName {
    /// All media.
    pub const ALL: [Self; 8] = [
        Self::Milk,
        Self::SkimmedMilk,
        Self::MuddyRiver,
        Self::Sea,
        Self::Coffee,
        Self::OrangeJuice,
        Self::Blood,
        Self::Honey,
    ];

    fn row(self) -> Row {
        TABLE.into_iter().find(|row| row.0 == self).unwrap_or(TABLE[0])
    }

    /// Its coefficients.
    pub fn medium(self) -> Medium {
        let (_, _, absorption, scattering, anisotropy, _) = self.row();
        let (absorption, scattering) = (Vec3::from(absorption), Vec3::from(scattering));
        Medium { absorption, scattering, anisotropy }
    }

    /// Its index of refraction.
    pub fn ior(self) -> f32 {
        self.row().5
    }

    /// A liquid of this medium, with coefficients for a body of a `thickness` in metres that looks as 1 m does.
    pub fn liquid(self, thickness: f32) -> Liquid {
        let Medium { absorption, scattering, anisotropy } = self.medium();
        let (absorption, scattering) = (absorption / thickness, scattering / thickness);
        let medium = Medium { absorption, scattering, anisotropy };
        Liquid { ior: self.ior(), ..Liquid::default() }.with(medium)
    }
}

impl fmt::Display for MediumName {
    /// Writes the form that [`MediumName::from_str`] parses.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.row().1)
    }
}

impl FromStr for MediumName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = TABLE.into_iter().find(|row| row.1 == text);
        named.map(|row| row.0).ok_or_else(|| {
            let names = TABLE.map(|row| row.1).join(", ");
            format!("expected one of {names}")
        })
    }
}
