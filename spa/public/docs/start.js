/* The relay's routes as its /openapi.json describes them; for `docs/` beside that file. */
window.SwaggerUIBundle({ dom_id: '#routes', url: '../openapi.json', deepLinking: true });
