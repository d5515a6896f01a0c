// the search button shows "Search Ctrl+K" and is called "Search": its words become its name
document.addEventListener("DOMContentLoaded", () => {
  for (const button of document.querySelectorAll(".search-button-field"))
    button.setAttribute("aria-label", button.innerText.replace(/\s+/g, " ").trim() || "Search");
});
