// A link that was copied, opened without the secret path: go on to the page if this browser knows where it is.
const inside = location.pathname === "/" && localStorage.getItem("inside");
if (inside) location.replace(inside + location.hash);
