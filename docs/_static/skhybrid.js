// names for two controls of the theme, as those who cannot see them hear them
document.addEventListener("DOMContentLoaded", () => {
  // the button shows "Search Ctrl+K" and is called "Search": its words become its name
  for (const button of document.querySelectorAll(".search-button-field"))
    button.setAttribute("aria-label", button.innerText.replace(/\s+/g, " ").trim() || "Search");
  for (const toggle of document.querySelectorAll("nav summary"))
    toggle.setAttribute("aria-label", `Pages of ${toggle.closest("li").querySelector("a").innerText}`);
});
