//! The browser viewer: data of the page ([`Page`]), a server on loopback ([`Server`]), and export to one file
//! ([`export_page`]). [`Live`] is the state of a running reconstruction, which the server shows; with a [`Rerun`] the page can
//! start one. The page is built from `viewer/` and embedded in this crate.

mod bundle;
mod camera;
mod cloud;
mod connections;
mod error;
mod guard;
mod http;
mod live;
mod obj;
mod page;
mod pending;
mod scene;
mod server;
mod single;
mod urdf;

pub use camera::{CameraView, Placement};
pub use cloud::Cloud;
pub use error::ViewError;
pub use live::Live;
pub use page::{FoundJoint, Page, Source};
pub use scene::{
    Scene, SceneAlternative, SceneBox, SceneCamera, SceneCloud, SceneJoint, SceneLink, SceneMesh, SceneRerun,
};
pub use server::{Rerun, Server};
pub use single::{export_page, page_html};
